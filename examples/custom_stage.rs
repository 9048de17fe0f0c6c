//! Adds a custom render stage between the labels and the screen, which draws ink lines where the label changes.
//!
//! ```sh
//! cargo run --release --example custom_stage
//! ```

use bevy::{prelude::*, shader::Shader};
use bevy_plenoctree::{LabelStages, prelude::*};

fn main() {
    App::new()
        .add_plugins((DefaultPlugins, PlenOctreePlugin))
        .add_systems(Startup, setup)
        .add_systems(Update, rotate)
        .run();
}

pub fn setup(mut commands: Commands, assets: Res<AssetServer>, mut shaders: ResMut<Assets<Shader>>) {
    commands.spawn((Prop(assets.load("toadstool.plenoctree")), Posterize::default()));
    // The shader could also be loaded from a file.
    let ink = shaders.add(Shader::from_wgsl(INK, "ink.wgsl"));
    commands.spawn((
        Camera3d::default(),
        LabelStages(vec![ink]),
        Transform::from_xyz(1.5, 1.3, 3.2).looking_at(Vec3::ZERO, Vec3::Y),
    ));
}

fn rotate(time: Res<Time>, mut props: Query<&mut Transform, With<Prop>>) {
    for mut transform in &mut props {
        transform.rotate_y(0.3 * time.delta_secs());
    }
}

/// Colors a pixel with ink if it is posterized and the label two pixels to the right or below is a different one.
const INK: &str = "
#import bevy_plenoctree::view::view

@group(1) @binding(0) var colors: texture_2d<f32>;
@group(1) @binding(1) var labels: texture_2d<u32>;

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<i32>(position.xy);
    let last = vec2<i32>(view.size) - 1;
    let here = textureLoad(labels, pixel, 0).r;
    let right = textureLoad(labels, min(pixel + vec2(2, 0), last), 0).r;
    let below = textureLoad(labels, min(pixel + vec2(0, 2), last), 0).r;
    let color = textureLoad(colors, pixel, 0);
    let is_ink = here > 1u && (here != right || here != below);
    return select(color, vec4(0.07, 0.05, 0.1, color.a), is_ink);
}
";
