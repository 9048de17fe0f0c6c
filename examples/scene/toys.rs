//! The props, each in its own style.

use bevy::prelude::*;
use bevy_plenoctree::{BlendSpace, Ink, Posterize, Prop, PropLighting, PropTint};

use crate::{
    build::color,
    night::{ByNight, Night, paint_by_night},
    room,
    stand::{Footprint, standing},
};

pub fn plugin(app: &mut App) {
    app.add_systems(Startup, spawn).add_systems(Update, (paint_by_night, dim, march));
}

/// Light with clean edges, for props of about this size.
const CARTOON: PropLighting = PropLighting::toon(2.0);

/// Light in soft steps.
const SOFT: PropLighting = PropLighting { bands: 3, self_shadow_distance: f32::MAX, ..CARTOON };

/// The part of their own light that props keep at night.
const DIM: Color = Color::linear_rgb(0.35, 0.35, 0.45);
/// How much brighter lamps make them at night.
const BRIGHT: f32 = 3.0;

/// Marches around the jar at night.
#[derive(Component)]
struct Marching {
    /// How long it has marched.
    seconds: f32,
}

/// The radius of the path around the jar.
const RADIUS: f32 = 2.2;
/// The speed along the path, in radians per second.
const SPEED: f32 = 0.45;
/// The angle at which the path starts, in radians.
const START: f32 = -0.75;

fn spawn(mut commands: Commands, assets: Res<AssetServer>) {
    // Some colors are brighter than white, so that the spots and the windows bloom.
    let toadstool = [
        ("red", Color::linear_rgb(0.09, 0.03, 0.3)),
        ("green", Color::linear_rgb(0.01, 0.1, 0.12)),
        ("brown", Color::linear_rgb(1.1, 0.55, 0.1)),
        ("gray", Color::linear_rgb(0.25, 1.5, 1.9)),
        ("cyan", Color::linear_rgb(0.02, 0.05, 0.3)),
    ];
    commands.spawn((
        Prop(assets.load("toadstool.plenoctree")),
        Posterize::toon(),
        CARTOON,
        ByNight(toadstool.into()),
        Footprint::of("toadstool.plenoctree"),
        standing(room::JAR, 1.3, 0.2),
    ));
    let drum = [("metal", "#5a66a8"), ("rug", "#173f63"), ("shell", "#632455"), ("trim", "#c08a4a")];
    commands.spawn((
        Prop(assets.load("drum.plenoctree")),
        Posterize::soft(),
        SOFT,
        PropTint::default(),
        ByNight(drum.map(|(ramp, hex)| (ramp, color(hex))).into()),
        Footprint::of("drum.plenoctree"),
        standing(Vec3::new(-3.2, 0.0, -0.5), 1.0, 0.35),
    ));
    let robot = [("body", "#1f6f8f"), ("trim", "#8f2a4c"), ("rubber", "#1c2048"), ("metal", "#8d9bd0")];
    commands.spawn((
        Prop(assets.load("robot.plenoctree")),
        Posterize::toon(),
        Ink { width: 0.02, max_pixels: 2.5, ..default() },
        CARTOON,
        PropTint::default(),
        ByNight(robot.map(|(ramp, hex)| (ramp, color(hex))).into()),
        Footprint::of("robot.plenoctree"),
        Marching { seconds: 0.0 },
        standing(Vec3::ZERO, 0.85, 0.0),
    ));
    // Drawn as trained. Its colors stay the same at night, as if the lamp lit it.
    commands.spawn((
        Prop(assets.load("gumballs.plenoctree")),
        SOFT,
        Footprint::of("gumballs.plenoctree"),
        standing(room::TABLE, 0.95, -0.3),
    ));
}

/// Props are darker at night, except where lamps shine on them.
fn dim(night: Res<Night>, mut props: Query<(&mut PropTint, &mut PropLighting)>) {
    for (mut tint, mut lighting) in &mut props {
        tint.0 = BlendSpace::Oklab.mix(Color::WHITE, DIM, night.0);
        lighting.brightness = CARTOON.brightness.lerp(BRIGHT, night.0);
    }
}

fn march(time: Res<Time>, night: Res<Night>, mut robots: Query<(&mut Marching, &mut Transform)>) {
    for (mut marching, mut place) in &mut robots {
        marching.seconds += night.0 * time.delta_secs();
        let angle = START + SPEED * marching.seconds;
        let direction = Vec3::new(angle.sin(), 0.0, angle.cos());
        let hop = 0.1 * (8.0 * marching.seconds).sin().abs();
        // Face the direction of travel.
        let ahead = angle + std::f32::consts::FRAC_PI_2;
        *place = standing(room::JAR.with_y(0.05 + hop) + RADIUS * direction, 0.85, ahead);
    }
}
