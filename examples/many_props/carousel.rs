//! A tiered carousel of rotating rings, as high as the number of toys requires, and a camera that sees all of it.

use bevy::{
    light::{CascadeShadowConfigBuilder, GlobalAmbientLight},
    prelude::*,
};

use crate::{
    build::{Builder, color},
    toys::spawn_toy,
};

/// Returns a plugin that spawns a carousel of `count` toys.
pub fn plugin(count: u32) -> impl Plugin {
    move |app: &mut App| {
        app.insert_resource(ClearColor(color("#fde8d7")))
            .insert_resource(GlobalAmbientLight { brightness: 900.0, ..default() })
            .add_systems(Startup, move |builder: Builder, assets: Res<AssetServer>| spawn(builder, &assets, count))
            .add_systems(Update, turn);
    }
}

/// The distance between neighboring rings, and between neighboring toys on a ring.
const SPACING: f32 = 2.3;
/// The height of a ring above the next one outward.
const STEP: f32 = 0.9;
/// The height of the toy in the middle at the top of its hops.
const TALLEST: f32 = 2.6;
/// The speed of the rings, in radians per second.
const SPEED: f32 = 0.06;

/// Rotates at this speed, in radians per second.
#[derive(Component)]
struct Turning(f32);

/// Returns the number of toys on each ring, from the single one in the middle outward, at about the same density.
fn rings(count: u32) -> Vec<u32> {
    let around = count.saturating_sub(1);
    let places = |ring: u32| (std::f32::consts::TAU * ring as f32) as u32;
    let (mut outermost, mut room) = (0, 0);
    while room < around {
        outermost += 1;
        room += places(outermost);
    }
    let mut rings = vec![count.min(1)];
    let mut left = around;
    for ring in 1..=outermost {
        // The ring gets its share of the remaining toys.
        let share = left * places(ring) / room;
        room -= places(ring);
        left -= share;
        rings.push(share);
    }
    rings
}

fn spawn(mut builder: Builder, assets: &AssetServer, count: u32) {
    let rings = rings(count);
    let outermost = rings.len() - 1;
    for (ring, places) in rings.into_iter().enumerate() {
        let height = STEP * (outermost - ring) as f32;
        build_tier(&mut builder, ring, height);
        let speed = if ring % 2 == 0 { SPEED } else { -SPEED };
        let turntable = (Transform::from_xyz(0.0, height, 0.0), Visibility::default(), Turning(speed));
        let turntable = builder.commands.spawn(turntable).id();
        for place in 0..places {
            let around = std::f32::consts::TAU * (place as f32 + 0.5 * (ring % 2) as f32) / places as f32;
            let at = Quat::from_rotation_y(around) * (SPACING * ring as f32 * Vec3::Z);
            let toy = spawn_toy(&mut builder.commands, assets, ring, place, at, around);
            builder.commands.entity(turntable).add_child(toy);
        }
    }
    let edge = SPACING * (outermost as f32 + 0.5);
    let plate = Cylinder::new(edge + 0.9, 0.16).mesh().resolution(128).build();
    builder.put(plate, color("#6fa8c9"), Transform::from_xyz(0.0, -0.55, 0.0));
    spawn_camera(&mut builder.commands, edge, STEP * outermost as f32 + TALLEST);
}

fn build_tier(builder: &mut Builder, ring: usize, height: f32) {
    let cake = ["#fbe3b8", "#f59fb4", "#9fdcc4", "#fbd07c", "#b9aef0"];
    let edge = SPACING * (ring as f32 + 0.5);
    let sponge = StandardMaterial { perceptual_roughness: 0.9, ..color(cake[ring % cake.len()]).into() };
    let tier = Cylinder::new(edge, height + 0.5).mesh().resolution(128).build();
    builder.put(tier, sponge, Transform::from_xyz(0.0, 0.5 * (height - 0.5), 0.0));
    let cream = Torus { minor_radius: 0.09, major_radius: edge - 0.06 };
    let cream = cream.mesh().major_resolution(128).minor_resolution(8).build();
    builder.put(cream, color("#fffaf0"), Transform::from_xyz(0.0, height, 0.0));
}

/// Spawns a camera in front and above, as close as possible while it sees a whole carousel of this radius and height.
fn spawn_camera(commands: &mut Commands, edge: f32, height: f32) {
    let (pitch, fov, aspect) = (0.42f32, 0.5f32, 1.5);
    let turn = Quat::from_rotation_x(-pitch);
    let up = 0.96 * (0.5 * fov).tan();
    let across = aspect * up;
    let plate = (0..32).map(|i| Quat::from_rotation_y(0.2 * i as f32) * ((edge + 0.9) * Vec3::Z) - 0.6 * Vec3::Y);
    // With the camera's rotation fixed, each point bounds its position from above, from below and from the back.
    let (mut above, mut below, mut back) = (f32::MIN, f32::MAX, f32::MIN);
    for point in plate.chain([height * Vec3::Y]).map(|point| turn.inverse() * point) {
        above = above.max(point.y + up * point.z);
        below = below.min(point.y - up * point.z);
        back = back.max(point.z + point.x.abs() / across);
    }
    let eye = Vec3::new(0.0, 0.5 * (above + below), back.max(0.5 * (above - below) / up));
    commands.spawn((
        Camera3d::default(),
        Projection::from(PerspectiveProjection { fov, far: 4.0 * eye.z, ..default() }),
        Transform::from_translation(turn * eye).with_rotation(turn),
    ));
    commands.spawn((
        DirectionalLight { illuminance: 9_000.0, shadow_maps_enabled: true, ..default() },
        Transform::default().looking_to(Vec3::new(0.6, -1.0, -0.5), Vec3::Y),
        CascadeShadowConfigBuilder { num_cascades: 1, maximum_distance: eye.z + 1.5 * edge, ..default() }.build(),
    ));
}

fn turn(time: Res<Time>, mut rings: Query<(&Turning, &mut Transform)>) {
    for (Turning(speed), mut place) in &mut rings {
        place.rotate_y(speed * time.delta_secs());
    }
}
