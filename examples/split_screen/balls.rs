//! Gumballs: they lie on the ground until robots carry them on their heads, which is the score.

use bevy::prelude::*;
use bevy_plenoctree::{BlendSpace, PaletteOverride, Palettes, Prop};

use crate::{
    arena::{Machine, Obstacle, RADIUS},
    build::{Builder, color},
    robots::{HEAD, Player, Robot, drive},
};

pub fn plugin(app: &mut App) {
    app.add_systems(PostStartup, scatter)
        .add_systems(Update, (pick_up, carry, end_round, show_leader).chain().after(drive));
}

const BALLS: usize = 18;
const SIZE: f32 = 0.16;
/// The distance at which a robot picks up a ball.
const GRASP: f32 = 0.75;
/// The number of balls that wins a round.
const WIN: usize = 7;

#[derive(Component)]
pub struct Ball {
    /// The position of the ball at the start of a round.
    home: Vec3,
    /// The robot that carries the ball, and the number of balls below it.
    carried: Option<(Entity, usize)>,
}

impl Ball {
    /// Returns whether the ball can be picked up. After a round, it has to get back to its home first.
    pub fn lies_at(&self, place: &Transform) -> bool {
        self.carried.is_none() && place.translation.distance(self.home) < SIZE
    }
}

fn scatter(mut builder: Builder, obstacles: Query<(&Obstacle, &Transform)>) {
    let candies = ["#e63946", "#f4a62a", "#ffe14d", "#43b35c", "#3a86ff", "#c65bd6"].map(color);
    for (index, candy) in candies.into_iter().cycle().take(BALLS).enumerate() {
        // Spread the balls over the arena, away from each other and outside obstacles.
        let around = Quat::from_rotation_y(std::f32::consts::TAU * 0.618_034 * index as f32);
        let mut home = around * (0.92 * RADIUS * ((index + 3) as f32 / (BALLS + 3) as f32).sqrt() * Vec3::Z);
        for (Obstacle(radius), obstacle) in &obstacles {
            let middle = obstacle.translation.with_y(0.0);
            let away = home - middle;
            home = middle + away.normalize_or(Vec3::Z) * away.length().max(radius + 0.7);
        }
        let home = home.clamp_length_max(RADIUS - 0.7) + SIZE * Vec3::Y;
        let candy = StandardMaterial { perceptual_roughness: 0.25, ..candy.into() };
        builder
            .put(Sphere::new(SIZE).mesh().uv(32, 16), candy, Transform::from_translation(home))
            .insert(Ball { home, carried: None });
    }
}

fn pick_up(mut robots: Query<(Entity, &mut Robot)>, mut balls: Query<(&mut Ball, &Transform), Without<Robot>>) {
    for (mut ball, place) in &mut balls {
        for (entity, mut robot) in &mut robots {
            if ball.lies_at(place) && robot.at.distance(place.translation.with_y(0.0)) < GRASP {
                ball.carried = Some((entity, robot.load));
                robot.load += 1;
            }
        }
    }
}

/// Moves every ball to where it belongs. The higher a pile is, the more it bends.
fn carry(time: Res<Time>, robots: Query<&Robot>, mut balls: Query<(&Ball, &mut Transform)>) {
    for (ball, mut place) in &mut balls {
        let carrier = ball.carried.and_then(|(entity, beneath)| Some((robots.get(entity).ok()?, beneath)));
        let (goal, pace) = match carrier {
            Some((robot, beneath)) => {
                let height = HEAD + SIZE * (1.0 + 1.9 * beneath as f32);
                (robot.at + height * Vec3::Y, 40.0 / (1.0 + 0.5 * beneath as f32))
            }
            None => (ball.home, 5.0),
        };
        place.translation = place.translation.lerp(goal, 1.0 - (-pace * time.delta_secs()).exp());
    }
}

fn end_round(mut robots: Query<&mut Robot>, mut balls: Query<&mut Ball>) {
    if robots.iter().any(|robot| robot.load >= WIN) {
        robots.iter_mut().for_each(|mut robot| robot.load = 0);
        balls.iter_mut().for_each(|mut ball| ball.carried = None);
    }
}

/// Tints the machine with the color of the leader, more strongly the greater the lead.
fn show_leader(
    palettes: Res<Palettes>,
    robots: Query<(&Player, &Robot)>,
    mut machines: Query<(&Prop, &mut PaletteOverride), With<Machine>>,
) {
    let loads = || robots.iter().map(|(_, robot)| robot.load);
    let lead = loads().max().unwrap_or(0) - loads().min().unwrap_or(0);
    let Some((leader, _)) = robots.iter().max_by_key(|(_, robot)| robot.load) else {
        return;
    };
    for (prop, mut colors) in &mut machines {
        let own = palettes.get(&prop.0).and_then(|palette| palette.ramp_color(palette.ramp("body")?));
        if let Some(own) = own {
            let share = (lead as f32 / 3.0).min(1.0);
            colors.set_ramp("body", BlendSpace::Oklab.mix(own, leader.team, share));
        }
    }
}
