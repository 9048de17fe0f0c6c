//! The scene: props, ground, sky and camera.

use bevy::{core_pipeline::tonemapping::Tonemapping, prelude::*};
use bevy_plenoctree::{BlendSpace, PaletteOverride, Posterize, Prop};

use crate::{
    game::{Target, Team},
    night::{ByNight, Night},
};

pub fn plugin(app: &mut App) {
    app.add_systems(Startup, (spawn_camera, spawn)).add_systems(PostUpdate, paint_sky_and_ground);
}

const SKY: [&str; 2] = ["#bfe3f2", "#141a3c"];
const GROUND: [&str; 2] = ["#9ad08f", "#22404f"];
const SHADOW: [&str; 2] = ["#7bb878", "#1a3242"];

/// The colors of a mesh's material by day and by night.
#[derive(Component)]
struct Painted([&'static str; 2]);

fn spawn_camera(mut commands: Commands) {
    commands.spawn((
        Camera3d::default(),
        Tonemapping::None,
        Msaa::Off,
        Projection::from(PerspectiveProjection { fov: 0.43, ..default() }),
        Transform::from_xyz(0.0, 2.4, 9.6).looking_at(Vec3::new(0.0, 1.12, 0.0), Vec3::Y),
    ));
}

fn spawn(
    mut commands: Commands,
    assets: Res<AssetServer>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let mut disc = |colors: [&'static str; 2], center: Vec3, radius: f32| {
        commands.spawn((
            Painted(colors),
            Mesh3d(meshes.add(Circle::new(radius))),
            MeshMaterial3d(materials.add(StandardMaterial { unlit: true, ..default() })),
            Transform::from_translation(center).with_rotation(Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2)),
        ));
    };
    disc(GROUND, Vec3::ZERO, 60.0);
    for (x, z, radius) in [(-0.75, -0.9, 1.35), (1.1, 0.6, 0.85), (-2.6, 0.0, 0.62), (2.6, 0.0, 0.62)] {
        disc(SHADOW, Vec3::new(x, 0.005, z), radius);
    }

    let prop = |file: &'static str, x: f32, z: f32, scale: f32, turn: f32| {
        // The origin of the props is 0.9 above the ground.
        let place = Transform::from_xyz(x, 0.9 * scale, z).with_scale(Vec3::splat(scale));
        (Prop(assets.load(file)), Posterize::default(), place.with_rotation(Quat::from_rotation_y(turn)))
    };
    commands.spawn((
        prop("toadstool.plenoctree", -0.75, -0.9, 1.5, 0.25),
        at_midnight([
            ("red", "#43307a"),
            ("green", "#1d4a52"),
            ("gray", "#8d9cd6"),
            ("tan", "#5d5a86"),
            ("brown", "#3a2440"),
        ]),
    ));
    commands.spawn((
        prop("drum.plenoctree", 1.1, 0.6, 0.85, -0.2),
        at_midnight([("metal", "#5a649a"), ("rug", "#173a5c"), ("shell", "#5a2350"), ("trim", "#b08a4a")]),
        PaletteOverride::default(),
        Target,
    ));
    for (x, turn, by_day, by_night) in [(-2.6, 0.45, "#e2473f", "#a3295c"), (2.6, -0.5, "#2f78e6", "#2a45b0")] {
        commands.spawn((
            prop("robot.plenoctree", x, 0.0, 1.0, turn),
            at_midnight([("trim", "#7a2350"), ("metal", "#7f8cc4"), ("rubber", "#12142c"), ("yellow", "#ffcf6a")]),
            PaletteOverride::default(),
            Team { by_day: color(by_day), by_night: color(by_night) },
        ));
    }
}

fn paint_sky_and_ground(
    night: Res<Night>,
    mut sky: ResMut<ClearColor>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    painted: Query<(&Painted, &MeshMaterial3d<StandardMaterial>)>,
) {
    let now = |[by_day, by_night]: [&str; 2]| BlendSpace::Oklab.mix(color(by_day), color(by_night), night.0);
    sky.0 = now(SKY);
    for (colors, material) in &painted {
        if let Some(mut material) = materials.get_mut(&material.0) {
            material.base_color = now(colors.0);
        }
    }
}

/// Names ramps and their colors at midnight.
fn at_midnight<const N: usize>(ramps: [(&'static str, &str); N]) -> ByNight {
    ByNight(ramps.map(|(ramp, hex)| (ramp, color(hex))).into())
}

/// Parses a hex code from this file. Invalid codes become black.
fn color(hex: &str) -> Color {
    Srgba::hex(hex).unwrap_or(Srgba::BLACK).into()
}
