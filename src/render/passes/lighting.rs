//! Finds how much of the scene's light is blocked before it reaches the solid parts of props with a `PropLighting`, and
//! how much falls on them. Labels read the result.
//!
//! The *fog* pass applies the camera's `DistanceFog` to props, pixel by pixel, as Bevy's materials do. It runs after
//! custom stages, so that what they draw on props fades with them. All of this requires the feature `shadows`.

use bevy::{
    core_pipeline::tonemapping::{Tonemapping, TonemappingLuts, get_lut_bind_group_layout_entries, get_lut_bindings},
    light::ShadowFilteringMethod,
    pbr::{
        DistanceFog, ExtractedPointLight, FogMeta, GlobalClusterableObjectMeta, GpuFog, GpuLights, LightMeta,
        ShadowSamplers, TONEMAPPING_LUT_SAMPLER_BINDING_INDEX, TONEMAPPING_LUT_TEXTURE_BINDING_INDEX,
        ViewClusterBindings, ViewFogUniformOffset, ViewLightsUniformOffset, ViewShadowBindings,
    },
    prelude::*,
    render::{
        Render, RenderSystems,
        camera::ExtractedCamera,
        globals::{GlobalsBuffer, GlobalsUniform},
        render_asset::RenderAssets,
        render_resource::{binding_types::*, *},
        renderer::RenderDevice,
        texture::{FallbackImage, GpuImage},
        view::{ViewUniform, ViewUniformOffset, ViewUniforms},
    },
    shader::ShaderDefVal,
};
use glam::DMat4;
use plenoctree::palette::PaletteLabel;

use super::labels::{shown_after, space};
use crate::{
    gpu::WrittenBuffer,
    lighting::PropLighting,
    render::{
        extract::{ExtractedProps, VisibleProps},
        frame::{Clear, Draw, FirstGroup, Pass, Pipelines, Place, Program, PropView, Slot},
        plan::{Feature, Plan, PlannedProp},
        shades::Shades,
        uniforms::LabelsUniform,
    },
    sets::PlenOctreeRenderSystems,
};

pub(super) const LIGHTING: &str = "plenoctree_lighting";
pub(super) const SMOOTH_LIGHT: &str = "plenoctree_smooth_light";
pub(super) const FOG: &str = "plenoctree_fog";

/// What `relief.wgsl` reads.
const RELIEF: [Slot; 4] = [Slot::Lit, Slot::View, Slot::DEPTH, Slot::OWNER];

/// Finds the light that reaches props.
pub(super) fn lighting(plan: &Plan) -> Option<Pass> {
    let program = |(lamps, filter)| {
        let program = Program::new("lighting").define(filter).define_if(lamps, "LAMPS");
        program.define_if(plan.is_brightened, "BRIGHTNESS").where_props_are()
    };
    let filters = if plan.is_brightened { &[shadow_filter(plan), HARD][..] } else { &[shadow_filter(plan)] };
    let programs = [false, true].into_iter().flat_map(|lamps| filters.iter().map(move |filter| (lamps, *filter)));
    let drawn = usize::from(plan.has_lamps) * filters.len() + usize::from(plan.smooths_all_light);
    plan.is_lit.then(|| Pass {
        feature: Feature::Lighting,
        group: FirstGroup::Lights,
        reads: vec![RELIEF.to_vec()],
        writes: vec![Slot::Light],
        depth: Some(Slot::DEPTH),
        clear: Some(Clear::White),
        // All programs are compiled from the start, so that props keep their light when the first lamp appears, or the
        // first prop whose light is not smoothed.
        draws: vec![Draw::triangle(drawn)],
        ..Pass::fullscreen(LIGHTING, Place::Layer, None, programs.map(program).collect())
    })
}

/// Smooths this light, if it makes props brighter.
pub(super) fn smooth_light(plan: &Plan) -> Option<Pass> {
    let program = Program::new("smooth_light").define_if(plan.posterizes_view, "POSTERIZED_VIEW").where_props_are();
    plan.is_brightened.then(|| Pass {
        feature: Feature::Lighting,
        group: FirstGroup::Lights,
        reads: vec![[&RELIEF[..], &[Slot::Light]].concat()],
        writes: vec![Slot::SmoothLight],
        depth: Some(Slot::DEPTH),
        clear: Some(Clear::White),
        ..Pass::fullscreen(SMOOTH_LIGHT, Place::Layer, None, vec![program])
    })
}

/// Hard edges of shadows, which smoothing the light softens.
const HARD: &str = "SHADOW_FILTER_METHOD_HARDWARE_2X2";

/// Returns the shader definition of how shadow maps are filtered.
fn shadow_filter(plan: &Plan) -> &'static str {
    // Temporal filtering is not supported: noise that changes from frame to frame would make the edges of bands flicker.
    if plan.has_hard_shadows { HARD } else { "SHADOW_FILTER_METHOD_GAUSSIAN" }
}

/// Fades what is shown of props into the fog.
pub(super) fn fog(plan: &Plan) -> Option<Pass> {
    let program =
        Program::new("fog").define("DISTANCE_FOG").define(shadow_filter(plan)).define_if(plan.smooths, "SMOOTH");
    let program = program.define_all(space(plan.target.space)).define_all(tonemapping(plan));
    let mut reads = vec![Slot::Screen, Slot::View, shown_after(plan.stages.len()), Slot::DEPTH, Slot::Scene];
    if plan.smooths {
        reads.extend([Slot::Outline, Slot::Coverage]);
    }
    plan.has_fog.then(|| Pass {
        feature: Feature::Fog,
        group: FirstGroup::Lights,
        reads: vec![reads],
        writes: vec![shown_after(plan.stages.len() + 1)],
        clear: Some(Clear::NegativeAlpha),
        ..Pass::fullscreen(FOG, Place::Present, None, vec![program])
    })
}

/// Returns the shader definitions of how the camera's materials map tones, as those that Bevy gives to them.
fn tonemapping(plan: &Plan) -> Vec<ShaderDefVal> {
    let method = match plan.tonemapping {
        None => return vec![],
        Some(Tonemapping::None) => "TONEMAP_METHOD_NONE",
        Some(Tonemapping::Reinhard) => "TONEMAP_METHOD_REINHARD",
        Some(Tonemapping::ReinhardLuminance) => "TONEMAP_METHOD_REINHARD_LUMINANCE",
        Some(Tonemapping::AcesFitted) => "TONEMAP_METHOD_ACES_FITTED",
        Some(Tonemapping::AgX) => "TONEMAP_METHOD_AGX",
        Some(Tonemapping::SomewhatBoringDisplayTransform) => "TONEMAP_METHOD_SOMEWHAT_BORING_DISPLAY_TRANSFORM",
        Some(Tonemapping::TonyMcMapface) => "TONEMAP_METHOD_TONY_MC_MAPFACE",
        Some(Tonemapping::BlenderFilmic) => "TONEMAP_METHOD_BLENDER_FILMIC",
        Some(Tonemapping::KhronosPbrNeutral) => "TONEMAP_METHOD_PBR_NEUTRAL",
    };
    let number = |name: &str, value| ShaderDefVal::UInt(name.into(), value);
    vec![
        "TONEMAPPED".into(),
        method.into(),
        number("TONEMAPPING_LUT_TEXTURE_BINDING_INDEX", TONEMAPPING_LUT_TEXTURE_BINDING_INDEX),
        number("TONEMAPPING_LUT_SAMPLER_BINDING_INDEX", TONEMAPPING_LUT_SAMPLER_BINDING_INDEX),
    ]
}

/// How lights fall on a prop. Matches `Lit` in `shade.wgsl`.
#[cfg_attr(test, derive(Reflect))]
#[derive(ShaderType, Clone, Copy, Default)]
pub(in crate::render) struct LitUniform {
    box_from_world: Mat4,
    shadows: f32,
    tint: f32,
    bands: u32,
    self_shadow_distance: f32,
    brightness: f32,
    rim: f32,
    radius: f32,
    first_shade: u32,
    labels: u32,
}

/// The distance within which a prop's surface is smoothed, in finest cells, so that bands do not show the steps of hard
/// surfaces. And the least and the largest one, relative to the prop's size.
const SMOOTHED_CELLS: f64 = 3.0;
const LEAST_SMOOTHED: f64 = 0.03;
const MOST_SMOOTHED: f64 = 0.07;

/// Returns how lights fall on the props of a view, and finds their shades.
pub(in crate::render) fn lit_props(plan: &Plan, extracted: &ExtractedProps, shades: &mut Shades) -> Vec<LitUniform> {
    shades.begin();
    let mut of = |at: usize, planned: &PlannedProp| {
        let prop = extracted.props.get(planned.index)?;
        let PropLighting { shadows, tint, bands, self_shadow_distance, brightness, rim } = prop.lighting?;
        let box_from_world = DMat4::from(prop.pose.box_from_world());
        let smoothed = (SMOOTHED_CELLS / prop.pose.cells_across()).clamp(LEAST_SMOOTHED, MOST_SMOOTHED);
        let radius = (smoothed / box_from_world.determinant().abs().cbrt()).min(f32::MAX.into()) as f32;
        let box_from_world = box_from_world.as_mat4();
        let unlabeled = LitUniform {
            box_from_world,
            shadows,
            tint,
            bands,
            self_shadow_distance,
            brightness,
            rim,
            radius,
            ..default()
        };
        let Some(&LabelsUniform { first_color, colors, blend_steps, .. }) = plan.labeling_of(at) else {
            return Some(unlabeled);
        };
        // The layer of a posterized view already has the tints of its props.
        let tint = if planned.is_posterized { prop.tint } else { Vec3::ONE };
        let palette = extracted.colors.list.get(first_color as usize..)?.get(..2 * colors as usize)?;
        // From the darkest band to the brightest one, or to the prop's own light.
        let factors: Vec<f32> = (0..=if brightness > 0.0 { 2 * bands } else { bands })
            .map(|row| row as f32 / bands as f32 - 1.0)
            .map(|added| 1.0 + added * if added < 0.0 { shadows } else { brightness })
            .collect();
        let first_shade = shades.find(palette, blend_steps, tint, &factors)?;
        let labels = PaletteLabel::count(colors as usize, blend_steps) as u32;
        Some(LitUniform { first_shade, labels, ..unlabeled })
    };
    let props = plan.props.iter().enumerate();
    props.map(|(at, prop)| of(at, prop).filter(|_| prop.kind.is_lit).unwrap_or_default()).collect()
}

pub(super) fn plugin(render_app: &mut SubApp) {
    render_app.add_systems(
        Render,
        (
            find_lights.before(PlenOctreeRenderSystems::PlanViews).in_set(RenderSystems::PrepareResources),
            bind_lights.run_if(resource_exists::<LightMeta>).in_set(RenderSystems::PrepareBindGroups),
        ),
    );
}

/// Returns the layout of what the shaders of lights and fog, and what they import from Bevy, read of its mesh view, at
/// the same places.
pub(in crate::render) fn lights_layout() -> BindGroupLayoutDescriptor {
    let [tonemapping_texture, tonemapping_sampler] = get_lut_bind_group_layout_entries();
    let lights = BindGroupLayoutEntries::with_indices(
        ShaderStages::FRAGMENT,
        (
            (0, uniform_buffer::<ViewUniform>(true)),
            (1, uniform_buffer::<GpuLights>(true)),
            (2, texture_cube_array(TextureSampleType::Depth)),
            (3, sampler(SamplerBindingType::Comparison)),
            (5, texture_2d_array(TextureSampleType::Depth)),
            (6, sampler(SamplerBindingType::Comparison)),
            (8, storage_buffer_read_only_sized(false, None)),
            (9, storage_buffer_read_only_sized(false, None)),
            (10, storage_buffer_read_only_sized(false, None)),
            (11, uniform_buffer::<GlobalsUniform>(false)),
            (13, uniform_buffer::<GpuFog>(true)),
            (TONEMAPPING_LUT_TEXTURE_BINDING_INDEX, tonemapping_texture),
            (TONEMAPPING_LUT_SAMPLER_BINDING_INDEX, tonemapping_sampler),
        ),
    );
    BindGroupLayoutDescriptor::new("plenoctree_lights", &lights)
}

/// What decides how lights and fog are drawn in a view.
type LightSettings =
    (&'static ExtractedCamera, Option<&'static ShadowFilteringMethod>, Has<DistanceFog>, Option<&'static Tonemapping>);

fn find_lights(
    lights: Option<Res<LightMeta>>,
    lamps: Query<(), With<ExtractedPointLight>>,
    mut views: Query<(&mut VisibleProps, LightSettings)>,
) {
    for (mut visible, (camera, method, has_fog, tonemapping)) in &mut views {
        visible.has_lights = lights.is_some();
        visible.has_lamps = !lamps.is_empty();
        visible.has_hard_shadows = method == Some(&ShadowFilteringMethod::Hardware2x2);
        visible.has_fog = has_fog;
        visible.tonemapping = tonemapping.copied().filter(|_| !camera.hdr);
    }
}

/// What a view knows of Bevy's lights.
type BevyLights<'a> = (
    &'a ViewShadowBindings,
    &'a ViewClusterBindings,
    &'a ViewUniformOffset,
    &'a ViewLightsUniformOffset,
    Option<&'a ViewFogUniformOffset>,
    Option<&'a Tonemapping>,
);

fn bind_lights(
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    pipelines: Res<Pipelines>,
    view_uniforms: Res<ViewUniforms>,
    (meta, fogs, clusterable, samplers, globals): (
        Res<LightMeta>,
        Res<FogMeta>,
        Res<GlobalClusterableObjectMeta>,
        Res<ShadowSamplers>,
        Res<GlobalsBuffer>,
    ),
    (images, luts, fallback): (Res<RenderAssets<GpuImage>>, Option<Res<TonemappingLuts>>, Res<FallbackImage>),
    mut views: Query<(&mut PropView, Option<BevyLights<'static>>)>,
) {
    let lights = |no_fog: &WrittenBuffer, (maps, clusters, view, lights, fog, tonemapping): BevyLights| {
        let tonemapping = tonemapping.unwrap_or(&Tonemapping::None);
        let (texture, sampler) = get_lut_bindings(&images, luts.as_ref()?, tonemapping, &fallback);
        let entries = BindGroupEntries::with_indices((
            (0, view_uniforms.uniforms.binding()?),
            (1, meta.view_gpu_lights.binding()?),
            (2, &maps.point_light_depth_texture_view),
            (3, &samplers.point_light_comparison_sampler),
            (5, &maps.directional_light_depth_texture_view),
            (6, &samplers.directional_light_comparison_sampler),
            (8, clusterable.gpu_clustered_lights.binding()?),
            (9, clusters.clusterable_object_index_lists_binding()?),
            (10, clusters.offsets_and_counts_binding()?),
            (11, globals.buffer.binding()?),
            (13, fog.and(fogs.gpu_fogs.binding()).or(no_fog.binding())?),
            (TONEMAPPING_LUT_TEXTURE_BINDING_INDEX, texture),
            (TONEMAPPING_LUT_SAMPLER_BINDING_INDEX, sampler),
        ));
        let layout = cache.get_bind_group_layout(pipelines.lights.as_ref()?);
        let group = device.create_bind_group("plenoctree_lights", &layout, &entries);
        Some((group, vec![view.offset, lights.offset, fog.map_or(0, |fog| fog.offset)]))
    };
    for (mut view, bevy) in &mut views {
        let bevy = bevy.filter(|_| view.plan.is_lit || view.plan.has_fog);
        view.lights = bevy.and_then(|bevy| lights(&view.buffers.no_fog, bevy));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::layouts::assert_layout;

    #[test]
    fn shaders_find_every_field() {
        assert_layout!(LitUniform, "shade", "Lit");
    }
}
