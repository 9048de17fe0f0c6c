//! A custom stage that changes nothing.

use bevy::{prelude::*, shader::Shader};
use bevy_plenoctree::LabelStages;

/// A stage that changes nothing.
const KEEP: &str = "
@group(1) @binding(0) var colors: texture_2d<f32>;

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    return textureLoad(colors, vec2<u32>(position.xy), 0);
}
";

/// Returns such a stage.
pub fn idle_stage(world: &mut World) -> LabelStages {
    let shader = Shader::from_wgsl(KEEP, "stage.wgsl");
    LabelStages(vec![world.resource_mut::<Assets<Shader>>().add(shader)])
}
