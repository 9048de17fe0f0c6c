//! Applies the camera's `DistanceFog` to props, pixel by pixel, as Bevy's materials do. Runs after custom stages, so that
//! what they draw on props fades with them. Requires the feature `shadows`.

use bevy::{
    core_pipeline::tonemapping::Tonemapping,
    pbr::{DistanceFog, FogFalloff, TONEMAPPING_LUT_SAMPLER_BINDING_INDEX, TONEMAPPING_LUT_TEXTURE_BINDING_INDEX},
    prelude::*,
    render::{
        Render,
        camera::ExtractedCamera,
        render_resource::{BufferUsages, ShaderType},
        renderer::{RenderDevice, RenderQueue},
    },
    shader::ShaderDefVal,
};

use super::{
    labels::{shown_after, space},
    lighting::shadow_filter,
};
use crate::{
    render::{
        extract::VisibleProps,
        frame::{Buffer, Clear, Input, Output, Pass, Place, Program, PropView, RaySet, Slot},
        plan::{Feature, Plan},
    },
    sets::PlenOctreeRenderSystems,
};

pub(super) const FOG: &str = "plenoctree_fog";

/// Fades what is shown of props into the fog.
pub(super) fn fog(plan: &Plan) -> Option<Pass> {
    let program = Program { lights: true, ..Program::new("fog") };
    let program =
        program.define(shadow_filter(plan)).define_all(space(plan.target.space)).define_all(tonemapping(plan));
    let program = program.define_if(plan.smooths, "SMOOTH");
    let edges = if plan.smooths { &[Slot::Outline, Slot::Coverage][..] } else { &[] };
    let buffers = [Buffer::Fog, Buffer::View].map(Input::Buffer);
    let textures = [shown_after(plan.stages.len()), Slot::Depth(RaySet::Pixels)].map(Input::Texture);
    plan.has_fog.then(|| Pass {
        feature: Feature::Fog,
        reads: vec![
            buffers
                .into_iter()
                .chain(textures)
                .chain([Input::Scene])
                .chain(edges.iter().map(|slot| Input::Texture(*slot)))
                .collect(),
        ],
        writes: vec![Some(Output::Texture(Slot::Fogged))],
        clear: Some(Clear::NegativeAlpha),
        ..Pass::fullscreen(FOG, Place::Present, None, program)
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

/// The camera's fog, as `Fog` of Bevy's `mesh_view_types.wgsl` declares it.
#[derive(ShaderType, Clone, Copy, Default)]
struct BevyFog {
    base_color: Vec4,
    directional_light_color: Vec4,
    be: Vec3,
    directional_light_exponent: f32,
    bi: Vec3,
    mode: u32,
}

/// Matches `Settings` in `fog.wgsl`.
#[derive(ShaderType, Clone, Copy, Default)]
struct FogUniform {
    fog: BevyFog,
    exposure: f32,
}

impl BevyFog {
    /// Returns the same as Bevy's `prepare_fog`.
    fn new(fog: &DistanceFog) -> Self {
        let (mode, be, bi) = match fog.falloff {
            FogFalloff::Linear { start, end } => (1, Vec3::new(start, end, 0.0), Vec3::ZERO),
            FogFalloff::Exponential { density } => (2, Vec3::new(density, 0.0, 0.0), Vec3::ZERO),
            FogFalloff::ExponentialSquared { density } => (3, Vec3::new(density, 0.0, 0.0), Vec3::ZERO),
            FogFalloff::Atmospheric { extinction, inscattering } => (4, extinction, inscattering),
        };
        Self {
            base_color: LinearRgba::from(fog.color).to_vec4(),
            directional_light_color: LinearRgba::from(fog.directional_light_color).to_vec4(),
            directional_light_exponent: fog.directional_light_exponent,
            be,
            bi,
            mode,
        }
    }
}

pub(super) fn plugin(render_app: &mut SubApp) {
    let find = find_fog.in_set(bevy::render::RenderSystems::PrepareResources);
    let write = write_fog.in_set(bevy::render::RenderSystems::PrepareResources);
    render_app.add_systems(
        Render,
        (find.before(PlenOctreeRenderSystems::PlanViews), write.after(PlenOctreeRenderSystems::PlanViews)),
    );
}

fn find_fog(mut views: Query<(&mut VisibleProps, &ExtractedCamera, Has<DistanceFog>, Option<&Tonemapping>)>) {
    for (mut visible, camera, has_fog, tonemapping) in &mut views {
        visible.has_fog = has_fog;
        visible.tonemapping = tonemapping.copied().filter(|_| !camera.hdr);
    }
}

fn write_fog(device: Res<RenderDevice>, queue: Res<RenderQueue>, mut views: Query<(&mut PropView, &DistanceFog)>) {
    for (mut view, fog) in &mut views {
        if view.plan.has_fog {
            let fog = FogUniform { fog: BevyFog::new(fog), exposure: view.plan.values.screen.exposure };
            view.buffers.fog.set(&device, &queue, "plenoctree_fog", BufferUsages::STORAGE, &fog);
        }
    }
}
