//! Applies the camera's `DistanceFog` to props, pixel by pixel, as Bevy's materials do. Runs after custom stages, so
//! that what they draw on props fades with them. Requires the feature `shadows`.

use bevy::{
    core_pipeline::tonemapping::Tonemapping,
    pbr::{TONEMAPPING_LUT_SAMPLER_BINDING_INDEX, TONEMAPPING_LUT_TEXTURE_BINDING_INDEX},
    shader::ShaderDefVal,
};

use super::{
    labels::{shown_after, space},
    lighting::shadow_filter,
};
use crate::render::{
    frame::{Clear, FirstGroup, Pass, Place, Program, Slot},
    plan::{Feature, Plan},
};

pub(super) const FOG: &str = "plenoctree_fog";

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
        writes: vec![Slot::Fogged],
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
