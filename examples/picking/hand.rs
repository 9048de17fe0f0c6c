//! Plays the game without a window: moves the pointer from place to place and clicks.

use bevy::{
    camera::NormalizedRenderTarget,
    picking::{
        PickingSystems,
        backend::ray::{RayId, RayMap},
        pointer::{Location, PointerAction, PointerId, PointerInput},
    },
    prelude::*,
};

pub fn plugin(app: &mut App) {
    app.add_systems(
        PreUpdate,
        (point, click).chain().after(PickingSystems::ProcessInput).before(PickingSystems::Backend),
    );
}

/// When the hand clicks, in seconds, and where.
const CLICKS: [(f32, Vec3); 8] = [
    (0.6, Vec3::new(-0.9, 0.3, 2.6)),
    (1.4, Vec3::new(0.0, 1.6, 0.6)),
    (2.4, Vec3::new(0.9, 0.3, 2.6)),
    (3.2, Vec3::new(-2.6, 0.4, 0.6)),
    (4.2, Vec3::new(0.3, 0.3, 2.6)),
    (5.0, Vec3::new(2.6, 0.8, 0.3)),
    (5.8, Vec3::new(1.5, 0.3, 2.6)),
    (6.6, Vec3::new(2.6, 0.2, 0.4)),
];

/// How long the hand takes to move to the next place, in seconds.
const MOVE_TIME: f32 = 0.5;

/// Returns where the hand points at a time, in seconds.
fn place(time: f32) -> Vec3 {
    let next = CLICKS.iter().position(|(at, _)| *at > time).unwrap_or(CLICKS.len() - 1);
    let (at, to) = CLICKS[next];
    let from = CLICKS[next.saturating_sub(1)].1;
    let share = ((time - at + 0.1) / MOVE_TIME + 1.0).clamp(0.0, 1.0);
    from.lerp(to, share * share * (3.0 - 2.0 * share))
}

/// Adds the pointer's ray. Cameras are inactive while nothing is drawn, and Bevy adds rays only for active ones.
fn point(time: Res<Time>, camera: Single<(Entity, &GlobalTransform), With<Camera3d>>, mut rays: ResMut<RayMap>) {
    let (camera, transform) = *camera;
    let eye = transform.translation();
    if let Ok(direction) = Dir3::new(place(time.elapsed_secs()) - eye) {
        rays.map.insert(RayId::new(camera, PointerId::Mouse), Ray3d::new(eye, direction));
    }
}

fn click(time: Res<Time>, mut inputs: MessageWriter<PointerInput>) {
    let now = time.elapsed_secs();
    let before = now - time.delta_secs();
    if CLICKS.iter().any(|(at, _)| before < *at && *at <= now) {
        // Any location will do, because the ray is already set.
        let location = Location { target: NormalizedRenderTarget::None { width: 1, height: 1 }, position: Vec2::ZERO };
        for action in [PointerAction::Press(PointerButton::Primary), PointerAction::Release(PointerButton::Primary)] {
            inputs.write(PointerInput::new(PointerId::Mouse, location.clone(), action));
        }
    }
}
