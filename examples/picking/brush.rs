//! The brush: stands at the point under the pointer, leans toward the surface normal, and marks the point with a ring.

use bevy::{picking::pointer::PointerInteraction, prelude::*};
use bevy_plenoctree::BlendSpace;

use crate::{
    build::{Builder, color},
    game::{Brush, PAINTS, pointed},
};

pub fn plugin(app: &mut App) {
    app.add_systems(Startup, spawn).add_systems(Update, (point, color_tip));
}

/// The root of the brush, at the point under the pointer.
#[derive(Component)]
struct Cursor;

/// The part of the brush that leans as if a hand held it.
#[derive(Component)]
struct Stick;

/// A part with paint on it.
#[derive(Component)]
struct Wet;

fn spawn(mut builder: Builder) {
    let cursor = builder.commands.spawn((Cursor, Transform::default(), Visibility::Hidden)).id();
    let stick = builder.commands.spawn((Stick, Transform::default(), Visibility::Inherited, ChildOf(cursor))).id();
    let paint = || StandardMaterial { unlit: true, ..default() };
    let at = |height: f32| Transform::from_xyz(0.0, height, 0.0);
    let flat = |height: f32| at(height).with_rotation(Quat::from_rotation_arc(Vec3::Z, Vec3::Y));
    let white = StandardMaterial { base_color: Color::WHITE, unlit: true, ..default() };
    builder.put(Annulus::new(0.085, 0.15), white, flat(0.02)).insert(ChildOf(cursor));
    builder.put(Annulus::new(0.097, 0.138), paint(), flat(0.025)).insert((Wet, ChildOf(cursor)));

    // Cones point up, but a brush points down.
    let upside_down = at(0.11).with_rotation(Quat::from_rotation_x(std::f32::consts::PI));
    builder.put(Cone { radius: 0.06, height: 0.22 }, paint(), upside_down).insert((Wet, ChildOf(stick)));
    builder.put(Cylinder::new(0.062, 0.15), color("#c9ccd4"), at(0.29)).insert(ChildOf(stick));
    let wood = ConicalFrustum { radius_bottom: 0.05, radius_top: 0.02, height: 0.8 };
    builder.put(wood, color("#b5472f"), at(0.76)).insert(ChildOf(stick));
}

/// Moves the brush to the point under the pointer.
fn point(
    pointers: Query<&PointerInteraction>,
    cameras: Query<&GlobalTransform, With<Camera3d>>,
    mut cursor: Single<(&mut Transform, &mut Visibility), With<Cursor>>,
    mut stick: Single<&mut Transform, (With<Stick>, Without<Cursor>)>,
) {
    let (transform, visibility) = &mut *cursor;
    let (Some(hit), Ok(camera)) = (pointers.iter().find_map(pointed), cameras.single()) else {
        visibility.set_if_neq(Visibility::Hidden);
        return;
    };
    visibility.set_if_neq(Visibility::Inherited);
    transform.translation = hit.point;
    transform.rotation = Quat::from_rotation_arc(Vec3::Y, *hit.normal);
    // Lean between the normal and a right hand in front of the screen.
    let hand = camera.rotation() * Vec3::new(0.55, 0.5, 0.65);
    let leaning = (0.6 * hit.normal + hand).normalize();
    stick.rotation = transform.rotation.inverse() * Quat::from_rotation_arc(Vec3::Y, leaning);
}

fn color_tip(
    time: Res<Time>,
    brush: Res<Brush>,
    wet: Query<&MeshMaterial3d<StandardMaterial>, With<Wet>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let share = 1.0 - (-12.0 * time.delta_secs()).exp();
    for material in &wet {
        if let Some(mut material) = materials.get_mut(&material.0) {
            material.base_color = BlendSpace::Oklab.mix(material.base_color, PAINTS[brush.paint], share);
        }
    }
}
