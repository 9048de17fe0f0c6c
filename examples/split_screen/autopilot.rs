//! Drives the robots whose players are absent.

use bevy::prelude::*;

use crate::{
    arena::Obstacle,
    balls::Ball,
    robots::{GIRTH, Player, Robot, drive, press_keys},
};

pub fn plugin(app: &mut App) {
    app.add_systems(Update, play_alone.after(press_keys).before(drive));
}

/// The distance at which a robot that plays by itself avoids an obstacle.
const CAUTION: f32 = 0.9;

/// Drives robots whose players are absent to the nearest ball, around obstacles.
fn play_alone(
    mut robots: Query<(&Player, &mut Robot)>,
    balls: Query<(&Ball, &Transform)>,
    obstacles: Query<(&Obstacle, &Transform)>,
) {
    for (_, mut robot) in robots.iter_mut().filter(|(player, _)| player.absent) {
        let free =
            balls.iter().filter(|(ball, place)| ball.lies_at(place)).map(|(_, place)| place.translation.with_y(0.0));
        let distance = |at: &Vec3| at.distance_squared(robot.at);
        let Some(goal) = free.min_by(|a, b| distance(a).total_cmp(&distance(b))) else {
            continue;
        };
        let mut way = (goal - robot.at).normalize_or_zero();
        for (Obstacle(radius), place) in &obstacles {
            let away = robot.at - place.translation.with_y(0.0);
            let gap = away.length() - radius - GIRTH;
            let inward = -way.dot(away.normalize_or_zero());
            if gap < CAUTION && inward > 0.0 {
                // Go around the obstacle, on the side closer to the direction of travel.
                let side = away.cross(Vec3::Y).normalize_or_zero();
                let side = if side.dot(way) < 0.0 { -side } else { side };
                way = way.lerp(side, (1.0 - gap / CAUTION).min(1.0)).normalize_or_zero();
            }
        }
        robot.wish = way;
    }
}
