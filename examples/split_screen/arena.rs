//! The ground and the obstacles.

use bevy::{
    light::{CascadeShadowConfigBuilder, GlobalAmbientLight},
    prelude::*,
};
use bevy_plenoctree::{PaletteOverride, Posterize, Prop};

use crate::{
    build::{Builder, color},
    stand::{Footprint, standing},
};

pub fn plugin(app: &mut App) {
    app.insert_resource(ClearColor(color("#20303c")))
        .insert_resource(GlobalAmbientLight { brightness: 700.0, ..default() })
        .add_systems(Startup, (build_ground, place_props));
}

/// The distance from the middle that robots can reach.
pub const RADIUS: f32 = 9.0;

/// The gumball machine, which shows the color of the leader.
#[derive(Component)]
pub struct Machine;

/// An obstacle that robots cannot walk through. Holds its radius on the ground.
#[derive(Component)]
pub struct Obstacle(pub f32);

fn build_ground(mut builder: Builder) {
    builder.commands.spawn((
        DirectionalLight { illuminance: 9_000.0, shadow_maps_enabled: true, ..default() },
        Transform::default().looking_to(Vec3::new(0.55, -1.0, -0.45), Vec3::Y),
        CascadeShadowConfigBuilder { num_cascades: 1, maximum_distance: 24.0, ..default() }.build(),
    ));
    // A lawn, mowed in rings.
    let lawn = ["#84d672", "#76c964"];
    for ring in 0..7 {
        let paint = StandardMaterial { perceptual_roughness: 1.0, ..color(lawn[ring % 2]).into() };
        let disc = Cylinder::new(RADIUS + 1.0 - 1.5 * ring as f32, 0.02).mesh().resolution(96).build();
        builder.put(disc, paint, Transform::from_xyz(0.0, 0.002 * ring as f32 - 0.012, 0.0));
    }
    let meadow = StandardMaterial { perceptual_roughness: 1.0, ..color("#62ad57").into() };
    builder.put(Circle::new(80.0), meadow, Transform::from_xyz(0.0, -0.03, 0.0).looking_to(Vec3::NEG_Y, Vec3::Z));
    // The fence, in both teams' colors.
    let posts = 44;
    for post in 0..posts {
        let around = Quat::from_rotation_y(std::f32::consts::TAU * post as f32 / posts as f32);
        let at = around * ((RADIUS + 0.7) * Vec3::Z);
        let paint = ["#f4f0e6", "#d9534a", "#f4f0e6", "#3f7fe0"][post % 4];
        builder.put(Capsule3d::new(0.13, 0.6), color(paint), Transform::from_translation(at + 0.3 * Vec3::Y));
    }
}

fn place_props(mut commands: Commands, assets: Res<AssetServer>) {
    commands.spawn((
        Prop(assets.load("gumballs.plenoctree")),
        Posterize::default(),
        PaletteOverride::default(),
        Footprint::of("gumballs.plenoctree"),
        Obstacle(1.3),
        Machine,
        standing(Vec3::ZERO, 1.7, 0.0),
    ));
    for (x, z, turn, cap) in [(-5.0, -3.2, 0.5, "#d8344e"), (5.2, -2.8, -0.5, "#e38a1f"), (0.2, -6.0, 0.0, "#8a4fd0")] {
        commands.spawn((
            Prop(assets.load("toadstool.plenoctree")),
            Posterize::default(),
            PaletteOverride::default().with_ramp("red", color(cap)),
            Footprint::of("toadstool.plenoctree"),
            Obstacle(1.25),
            standing(Vec3::new(x, 0.0, z), 1.35, turn),
        ));
    }
    for (x, z) in [(1.6, 6.2), (-6.4, 2.2), (6.2, 2.6)] {
        commands.spawn((
            Prop(assets.load("drum.plenoctree")),
            Posterize::default(),
            Footprint::of("drum.plenoctree"),
            Obstacle(0.9),
            standing(Vec3::new(x, 0.0, z), 0.85, x),
        ));
    }
}
