//! Shared by the benchmarks.

use bevy::prelude::*;

/// Moves every camera a little in every frame, because a view that does not change is not drawn again.
pub fn sway(mut cameras: Query<&mut Transform, With<Camera3d>>, mut is_right: Local<bool>) {
    *is_right = !*is_right;
    for mut camera in &mut cameras {
        let step = camera.right() * if *is_right { 1e-4 } else { -1e-4 };
        camera.translation += step;
    }
}
