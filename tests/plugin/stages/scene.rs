//! A scene whose frames can be worked out by hand.

use bevy::{camera::ScalingMode, prelude::*};
use bevy_plenoctree::{FieldPalette, Palette, PlenOctree, Prop, headless::LitMeshPlugins};

pub use crate::stage::{
    Stage,
    fields::SOLID,
    pixels::{assert_near, at, differing, is_near, middle},
};
use crate::stage::{fields, pixels::encoded};

/// The width and height of a frame, in pixels.
pub const SIZE: u32 = 48;
/// The color that the field emits, the first of its palette.
pub const COLOR: Color = Color::srgb(0.6, 0.3, 0.8);
/// The source colors of the palette.
pub const PALETTE: [Color; 3] = [COLOR, Color::srgb(0.1, 0.15, 0.1), Color::srgb(0.9, 0.85, 0.3)];
/// The shown colors of the palette.
pub const SHOWN: [Color; 3] =
    [Color::srgb(0.1, 0.55, 0.85), Color::srgb(0.98, 0.97, 0.9), Color::srgb(0.75, 0.15, 0.2)];

/// Bakes the cube from -0.5 to 0.5, in [`COLOR`].
pub fn cube(density: f64) -> PlenOctree {
    fields::cube(density, encoded(COLOR))
}

/// Creates a scene with a cube of this density at the origin, seen from z = 3 over black.
pub fn scene(density: f64) -> Stage {
    scene_with(density, |_| ())
}

/// Creates the same scene in an app for meshes, lights and effects, too.
pub fn scene_with_meshes(density: f64) -> Stage {
    scene_with(density, |app| _ = app.add_plugins(LitMeshPlugins))
}

/// Creates the same scene in an app that `configure` adds to.
pub fn scene_with(density: f64, configure: impl FnOnce(&mut App)) -> Stage {
    let mut stage = Stage::with(UVec2::splat(SIZE), configure);
    stage.spawn_prop(&cube(density), ());
    stage.paint(palette());
    stage.set(Transform::from_xyz(0.0, 0.0, 3.0));
    stage.wait();
    stage
}

/// Shows a cube of another density.
pub fn fill(stage: &mut Stage, density: f64) {
    let field = stage.add(cube(density));
    stage.dress(Prop(field));
    stage.paint(palette());
    stage.wait();
}

/// Spawns a square that faces the camera.
pub fn spawn_square(stage: &mut Stage, center: Vec3, size: f32, material: StandardMaterial) -> Entity {
    stage.spawn_mesh(Rectangle::new(size, size), material, Transform::from_translation(center))
}

/// [`PALETTE`], shown as [`SHOWN`].
pub fn palette() -> FieldPalette {
    let mut palette = FieldPalette::new(Palette::new(PALETTE.map(|color| encoded(color).into()).to_vec()).unwrap());
    SHOWN.into_iter().enumerate().for_each(|(index, color)| _ = palette.set(index, color));
    palette
}

/// Returns a projection that shows a square of two units around the camera's axis.
pub fn orthographic() -> Projection {
    let scaling_mode = ScalingMode::Fixed { width: 2.0, height: 2.0 };
    Projection::Orthographic(OrthographicProjection { scaling_mode, ..OrthographicProjection::default_3d() })
}

/// Returns the color of a prop of this opacity over a background, if the camera multiplies the prop's light by
/// `exposure`.
pub fn over(opacity: f32, prop: Color, background: Color, exposure: f32) -> Color {
    let encoded = Srgba::from(background.to_linear() * (1.0 / exposure)).to_vec3();
    let mixed = Srgba::from(prop).to_vec3() * opacity + encoded * (1.0 - opacity);
    (Color::srgb(mixed.x, mixed.y, mixed.z).to_linear() * exposure).into()
}
