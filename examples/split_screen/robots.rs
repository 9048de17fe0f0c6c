//! The robots and their players.

use bevy::prelude::*;
use bevy_plenoctree::{PaletteOverride, Posterize, Prop};

use crate::{
    arena::{Obstacle, RADIUS},
    build::color,
    stand::{Footprint, standing},
};

pub fn plugin(app: &mut App) {
    app.add_systems(Startup, spawn).add_systems(Update, (press_keys, drive).chain());
}

/// The height of the top of a robot's head.
pub const HEAD: f32 = 1.97;
/// The radius of a robot in collisions.
pub const GIRTH: f32 = 0.55;
/// The speed of a robot, in meters per second.
const SPEED: f32 = 2.8;
/// How fast a robot's velocity and heading approach their goals, per second.
const EASE: f32 = 9.0;

/// The player who drives a robot.
#[derive(Component)]
pub struct Player {
    /// The player's number, from 0.
    pub index: usize,
    pub team: Color,
    /// The keys to move away from the camera, toward it, left and right.
    keys: [KeyCode; 4],
    /// Whether the player has not pressed a key yet.
    pub absent: bool,
}

#[derive(Component, Default)]
pub struct Robot {
    pub at: Vec3,
    /// The number of gumballs on its head.
    pub load: usize,
    /// The direction in which its player wants to go, with a length of at most 1.
    pub wish: Vec3,
    velocity: Vec3,
    /// The heading, in radians from +z.
    turn: f32,
    /// The distance walked so far, in meters.
    walked: f32,
}

fn spawn(mut commands: Commands, assets: Res<AssetServer>) {
    use KeyCode::*;
    let players = [
        ("#e2473f", [KeyW, KeyS, KeyA, KeyD], Vec3::new(-2.5, 0.0, 5.5)),
        ("#2f78e6", [ArrowUp, ArrowDown, ArrowLeft, ArrowRight], Vec3::new(3.0, 0.0, -2.5)),
    ];
    for (index, (team, keys, at)) in players.into_iter().enumerate() {
        let team = color(team);
        commands.spawn((
            Prop(assets.load("robot.plenoctree")),
            Posterize::default(),
            PaletteOverride::default().with_ramp("body", team),
            Footprint::of("robot.plenoctree"),
            Player { index, team, keys, absent: true },
            Robot { at, ..default() },
        ));
    }
}

pub fn press_keys(keys: Res<ButtonInput<KeyCode>>, mut robots: Query<(&mut Player, &mut Robot)>) {
    for (mut player, mut robot) in &mut robots {
        let pressed = player.keys.map(|key| f32::from(u8::from(keys.pressed(key))));
        let [away, near, left, right] = pressed;
        player.absent &= pressed == [0.0; 4];
        robot.wish = Vec3::new(right - left, 0.0, near - away).normalize_or_zero();
    }
}

pub fn drive(
    time: Res<Time>,
    mut robots: Query<(&mut Robot, &mut Transform), Without<Obstacle>>,
    obstacles: Query<(&Obstacle, &Transform)>,
) {
    let seconds = time.delta_secs();
    let ease = 1.0 - (-EASE * seconds).exp();
    for (mut robot, mut place) in &mut robots {
        let goal = SPEED * robot.wish;
        robot.velocity = robot.velocity.lerp(goal, ease);
        let step = robot.velocity * seconds;
        robot.at += step;
        robot.walked += step.length();
        for (Obstacle(radius), obstacle) in &obstacles {
            let middle = obstacle.translation.with_y(0.0);
            let away = robot.at - middle;
            robot.at = middle + away.normalize_or(Vec3::Z) * away.length().max(radius + GIRTH);
        }
        robot.at = robot.at.clamp_length_max(RADIUS - GIRTH);
        // Turn toward the direction of travel.
        if robot.wish != Vec3::ZERO {
            let ahead = Vec3::new(robot.turn.sin(), 0.0, robot.turn.cos());
            let off = ahead.cross(robot.wish).y.atan2(ahead.dot(robot.wish));
            robot.turn += ease * off;
        }
        let hop = 0.1 * (3.2 * robot.walked).sin().abs();
        *place = standing(robot.at + hop * Vec3::Y, 1.0, robot.turn);
    }
}
