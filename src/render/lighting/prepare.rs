//! The props of a view that lights fall on, and the bind groups of the pass.

use bevy::{
    camera::MainPassResolutionOverride,
    pbr::{GlobalClusterableObjectMeta, LightMeta, ShadowSamplers, ViewClusterBindings, ViewShadowBindings},
    prelude::*,
    render::{
        Extract,
        camera::ExtractedCamera,
        globals::GlobalsBuffer,
        render_resource::{BindGroup, BindGroupEntries, PipelineCache, StorageBuffer, TextureView},
        renderer::{RenderDevice, RenderQueue},
        view::ViewUniforms,
    },
};
use glam::DMat4;

use super::{
    LightingLayout, ReadLighting,
    pipeline::{LIGHT_FORMAT, LightingPipeline, LitUniform},
};
use crate::{
    lighting::PropLighting,
    prop::Prop,
    render::{
        bind_group::KeptBindGroup,
        extract::ExtractedProps,
        view::{ViewMemory, ViewProps, ViewTextures, drawn_viewport},
    },
    stage::PropStage,
};

/// The lit props of a view.
#[derive(Component, Default)]
pub(super) struct ViewLighting {
    /// One per drawn prop.
    lit: StorageBuffer<Vec<LitUniform>>,
    /// The pass's output, if there are lit props.
    pub light: Option<TextureView>,
    /// Bind group 0.
    pub lights: Option<BindGroup>,
    /// Bind group 1.
    pub props: KeptBindGroup,
}

pub(super) fn extract_lighting(
    mut extracted: ResMut<ExtractedProps>,
    props: Extract<Query<(Entity, &PropLighting), With<Prop>>>,
) {
    let ExtractedProps { props: list, index, .. } = &mut *extracted;
    for (entity, lighting) in &props {
        let own = index.get(&entity).copied();
        let stand_in = own.and_then(|own| list.get(own)?.stand_in);
        for prop in [own, stand_in].into_iter().flatten() {
            if let Some(prop) = list.get_mut(prop) {
                prop.lighting = Some(lighting.clamped());
            }
        }
    }
}

/// Writes the settings of lit props, at the place in the frame where lights are known.
pub(super) fn prepare_lit(
    extracted: Res<ExtractedProps>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    mut views: Query<(
        Option<&ExtractedCamera>,
        Option<&MainPassResolutionOverride>,
        &ViewProps,
        &mut ViewMemory,
        &mut ViewLighting,
        &mut ReadLighting,
    )>,
) {
    for (camera, resolution, props, mut memory, mut lighting, mut read) in &mut views {
        let is_lit = props.stage == PropStage::Scene && props.drawn.iter().any(|prop| prop.lit.is_some());
        let viewport = camera.filter(|_| is_lit).and_then(|camera| drawn_viewport(camera, resolution));
        let light = viewport
            .and_then(|viewport| memory.view(&device, "plenoctree_light", LIGHT_FORMAT, viewport.physical_size));
        let Some(light) = light else {
            if read.is_lit {
                (*read, *lighting) = default();
            }
            continue;
        };
        lighting.light = Some(light);
        let lit = lighting.lit.get_mut();
        lit.clear();
        lit.extend(props.drawn.iter().map(|drawn| {
            let prop = drawn.lit.and_then(|index| extracted.props.get(index));
            let settings = prop.and_then(|prop| Some((prop, prop.lighting?)));
            settings.map_or_else(LitUniform::default, |(prop, lighting)| {
                let PropLighting { shadows, tint, bands, self_shadow_distance } = lighting;
                let box_from_world = DMat4::from(prop.placement.box_from_world()).as_mat4();
                // Shaders may treat infinity as anything.
                let self_shadow_distance = self_shadow_distance.min(f32::MAX);
                LitUniform { box_from_world, shadows, tint, bands, self_shadow_distance }
            })
        }));
        lighting.lit.write_buffer(&device, &queue);
        read.is_lit = true;
    }
}

pub(super) fn prepare_bind_groups(
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    pipeline: Res<LightingPipeline>,
    layout: Res<LightingLayout>,
    view_uniforms: Res<ViewUniforms>,
    bevy: (
        Option<Res<LightMeta>>,
        Option<Res<GlobalClusterableObjectMeta>>,
        Option<Res<ShadowSamplers>>,
        Res<GlobalsBuffer>,
    ),
    mut views: Query<(
        Option<&ViewTextures>,
        Option<(&ViewShadowBindings, &ViewClusterBindings)>,
        &mut ViewLighting,
        &mut ReadLighting,
    )>,
) {
    for (textures, maps, mut lighting, mut read) in &mut views {
        let ViewLighting { lit, light, lights, props } = &mut *lighting;
        let (Some(textures), Some(light), Some(lit)) = (textures, light, lit.binding()) else {
            continue;
        };
        let entries = BindGroupEntries::sequential((lit.clone(), &*light, &textures.layer.owner));
        read.group.update(&device, &cache, "plenoctree_lit", &layout.0, &entries);
        let entries = BindGroupEntries::sequential((lit, &textures.layer.depth, &textures.layer.owner));
        props.update(&device, &cache, "plenoctree_lighting", &pipeline.props, &entries);
        *lights = None;
        // Without Bevy's lights, there is nothing to read.
        let (Some(meta), Some(clusterable), Some(samplers), globals) = &bevy else {
            continue;
        };
        if let (Some((maps, clusters)), Some(view), Some(gpu_lights), Some(lamps), Some(globals)) = (
            maps,
            view_uniforms.uniforms.binding(),
            meta.view_gpu_lights.binding(),
            clusterable.gpu_clustered_lights.binding(),
            globals.buffer.binding(),
        ) && let (Some(indices), Some(offsets)) =
            (clusters.clusterable_object_index_lists_binding(), clusters.offsets_and_counts_binding())
        {
            let entries = BindGroupEntries::with_indices((
                (0, view),
                (1, gpu_lights),
                (2, &maps.point_light_depth_texture_view),
                (3, &samplers.point_light_comparison_sampler),
                (5, &maps.directional_light_depth_texture_view),
                (6, &samplers.directional_light_comparison_sampler),
                (8, lamps),
                (9, indices),
                (10, offsets),
                (11, globals),
            ));
            let layout = cache.get_bind_group_layout(&pipeline.lights);
            *lights = Some(device.create_bind_group("plenoctree_lights", &layout, &entries));
        }
    }
}
