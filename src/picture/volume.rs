//! The volume pass: every visible prop into the view's layer, back to front.

use bevy::{
    prelude::*,
    render::{
        diagnostic::RecordDiagnostics,
        render_asset::RenderAssets,
        render_resource::{
            BindGroup, BindGroupEntries, BindGroupLayoutDescriptor, BlendComponent, BlendFactor, BlendOperation,
            BlendState, CachedRenderPipelineId, ColorTargetState, ColorWrites, Face, FragmentState, LoadOp, Operations,
            PipelineCache, PrimitiveState, RenderPassColorAttachment, RenderPassDescriptor, RenderPipelineDescriptor,
            SpecializedRenderPipeline, SpecializedRenderPipelines, StoreOp, VertexState,
        },
        renderer::{RenderContext, RenderDevice, ViewQuery},
        view::ViewDepthTexture,
    },
    shader::Shader,
};

use super::{
    textures::{DISTANCE_FORMAT, LAYER_FORMAT, OWNER_FORMAT, PropTextures},
    view::{ViewLayouts, ViewProps},
};
use crate::{
    field::{Activation, Basis},
    gpu::{FieldLayouts, GpuField, Shaders, radiance_definitions},
};

/// Name of the pass's span in Bevy's render diagnostics.
pub const VOLUME_SPAN: &str = "plenoctree_volume";

/// `NOWHERE` of `view.wgsl`.
const NOWHERE: wgpu::Color = wgpu::Color { r: 1000.0, g: 0.0, b: 0.0, a: 0.0 };

#[derive(Resource)]
pub(super) struct VolumePipeline {
    shader: Handle<Shader>,
    view: [BindGroupLayoutDescriptor; 2],
    fields: FieldLayouts,
}

/// What the shader is compiled for: a field of SH1 runs no arithmetic of SH9.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct VolumeKey {
    basis: Basis,
    activation: Activation,
    parts: usize,
    multisampled: bool,
}

pub(super) fn init(
    mut commands: Commands,
    layouts: Res<ViewLayouts>,
    fields: Res<FieldLayouts>,
    shaders: Res<Shaders>,
) {
    commands.insert_resource(VolumePipeline {
        shader: shaders.volume.clone(),
        view: [layouts.volume.clone(), layouts.volume_multisampled.clone()],
        fields: fields.clone(),
    });
}

impl SpecializedRenderPipeline for VolumePipeline {
    type Key = VolumeKey;

    fn specialize(&self, key: VolumeKey) -> RenderPipelineDescriptor {
        let mut definitions = radiance_definitions(key.basis, key.activation, key.parts);
        if key.multisampled {
            definitions.push("MULTISAMPLED".into());
        }
        let over = |src_factor| BlendState {
            color: BlendComponent {
                src_factor,
                dst_factor: BlendFactor::OneMinusSrcAlpha,
                operation: BlendOperation::Add,
            },
            alpha: BlendComponent::OVER,
        };
        let target =
            |format, blend| Some(ColorTargetState { format, blend: Some(blend), write_mask: ColorWrites::ALL });
        RenderPipelineDescriptor {
            label: Some("plenoctree_volume".into()),
            layout: vec![self.view[usize::from(key.multisampled)].clone(), self.fields.get(key.parts).clone()],
            vertex: VertexState {
                shader: self.shader.clone(),
                shader_defs: definitions.clone(),
                entry_point: Some("vertex".into()),
                ..default()
            },
            // Back faces: each pixel of the box once, also from inside it.
            primitive: PrimitiveState { cull_mode: Some(Face::Front), ..default() },
            fragment: Some(FragmentState {
                shader: self.shader.clone(),
                shader_defs: definitions,
                entry_point: Some("fragment".into()),
                targets: vec![
                    target(LAYER_FORMAT, over(BlendFactor::One)),
                    // The nearest prop that is opaque enough owns the pixel.
                    target(OWNER_FORMAT, over(BlendFactor::SrcAlpha)),
                    target(DISTANCE_FORMAT, over(BlendFactor::SrcAlpha)),
                ],
            }),
            ..default()
        }
    }
}

/// The pipeline of every prop of a view, in drawing order.
#[derive(Component, Default)]
pub(super) struct VolumePipelines(Vec<CachedRenderPipelineId>);

pub(super) fn prepare_pipelines(
    mut commands: Commands,
    cache: Res<PipelineCache>,
    pipeline: Res<VolumePipeline>,
    mut specialized: ResMut<SpecializedRenderPipelines<VolumePipeline>>,
    fields: Res<RenderAssets<GpuField>>,
    views: Query<(Entity, &ViewProps, &Msaa)>,
) {
    for (entity, props, msaa) in &views {
        let ids = props.fields.iter().filter_map(|id| fields.get(*id)).map(|field| {
            let key = VolumeKey {
                basis: field.basis,
                activation: field.activation,
                parts: field.parts,
                multisampled: msaa.samples() > 1,
            };
            specialized.specialize(&cache, &pipeline, key)
        });
        commands.entity(entity).insert(VolumePipelines(ids.collect()));
    }
}

/// Bind group 0 of the pass.
#[derive(Component)]
pub(super) struct VolumeBindGroup(BindGroup);

pub(super) fn prepare_bind_groups(
    mut commands: Commands,
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    layouts: Res<ViewLayouts>,
    views: Query<(Entity, &ViewProps, &ViewDepthTexture, &Msaa)>,
) {
    for (entity, props, depth, msaa) in &views {
        let Some((view, list, colors)) = props.bindings() else {
            commands.entity(entity).remove::<VolumeBindGroup>();
            continue;
        };
        let layout = if msaa.samples() > 1 { &layouts.volume_multisampled } else { &layouts.volume };
        let group = device.create_bind_group(
            "plenoctree_volume_view",
            &cache.get_bind_group_layout(layout),
            &BindGroupEntries::sequential((view, list, colors, depth.view())),
        );
        commands.entity(entity).insert(VolumeBindGroup(group));
    }
}

pub(super) fn volume_pass(
    view: ViewQuery<(&PropTextures, &ViewProps, &VolumePipelines, &VolumeBindGroup)>,
    cache: Res<PipelineCache>,
    fields: Res<RenderAssets<GpuField>>,
    mut ctx: RenderContext,
) {
    let (textures, props, pipelines, bind_group) = view.into_inner();
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), VOLUME_SPAN);
    {
        let clear = |view, color| {
            Some(RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target: None,
                ops: Operations { load: LoadOp::Clear(color), store: StoreOp::Store },
            })
        };
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(VOLUME_SPAN),
            color_attachments: &[
                clear(&textures.layer, default()),
                clear(&textures.owner, default()),
                clear(&textures.distance, NOWHERE),
            ],
            ..default()
        });
        pass.set_bind_group(0, &bind_group.0, &[]);
        for (index, (id, pipeline)) in props.fields.iter().zip(&pipelines.0).enumerate() {
            let Some(group) = fields.get(*id).and_then(|field| field.bind_group.as_ref()) else {
                continue;
            };
            let Some(pipeline) = cache.get_render_pipeline(*pipeline) else {
                continue;
            };
            pass.set_render_pipeline(pipeline);
            pass.set_bind_group(1, group, &[]);
            let instance = index as u32;
            pass.draw(0..36, instance..instance + 1);
        }
    }
    span.end(ctx.command_encoder());
}
