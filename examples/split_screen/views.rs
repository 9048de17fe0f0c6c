//! One view per player, side by side.

use bevy::{camera::Viewport, prelude::*};

use crate::robots::{Player, Robot, drive};

pub fn plugin(app: &mut App) {
    app.add_systems(PostStartup, spawn).add_systems(Update, (divide, follow.after(drive)));
}

/// Pixels between two views.
const GAP: u32 = 4;
/// How fast a camera catches up with its robot, per second.
const PACE: f32 = 4.0;

/// The camera that follows a player.
#[derive(Component)]
struct ViewOf(Entity);

/// The position of a camera relative to its robot.
const EYE: Vec3 = Vec3::new(0.0, 6.0, 7.6);
/// The point that a camera looks at, relative to its robot.
const FOCUS: Vec3 = Vec3::new(0.0, 1.6, 0.0);

fn spawn(mut commands: Commands, players: Query<(Entity, &Player, &Robot)>) {
    for (entity, player, robot) in &players {
        commands.spawn((
            Camera3d::default(),
            Camera { order: player.index as isize, ..default() },
            Projection::from(PerspectiveProjection { fov: 0.7, ..default() }),
            Transform::from_translation(robot.at + EYE).looking_at(robot.at + FOCUS, Vec3::Y),
            ViewOf(entity),
        ));
    }
}

fn follow(time: Res<Time>, robots: Query<&Robot>, mut views: Query<(&ViewOf, &mut Transform)>) {
    let share = 1.0 - (-PACE * time.delta_secs()).exp();
    for (ViewOf(player), mut place) in &mut views {
        if let Ok(robot) = robots.get(*player) {
            place.translation = place.translation.lerp(robot.at + EYE, share);
        }
    }
}

/// Divides the window evenly between the views, for any window size.
fn divide(mut views: Query<&mut Camera, With<ViewOf>>) {
    let count = views.iter().len() as u32;
    for mut camera in &mut views {
        let Some(whole) = camera.physical_target_size() else {
            continue;
        };
        let size = UVec2::new((whole.x.saturating_sub(GAP * (count - 1)) / count).max(1), whole.y);
        if camera.viewport.as_ref().is_none_or(|viewport| viewport.physical_size != size) {
            let physical_position = UVec2::new(camera.order as u32 * (size.x + GAP), 0);
            camera.viewport = Some(Viewport { physical_position, physical_size: size, ..default() });
        }
    }
}
