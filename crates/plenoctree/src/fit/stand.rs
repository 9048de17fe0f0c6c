//! Turns inputs upright.

use glam::{DMat3, DQuat, DVec3};

use super::input::{FitInput, View};

/// Returns the rotation that turns the mean up direction of the cameras to z.
pub fn upright(views: &[View]) -> DMat3 {
    let up: DVec3 = views.iter().map(|view| view.camera.rotation.y_axis).sum();
    up.try_normalize().map_or(DMat3::IDENTITY, |up| DMat3::from_quat(DQuat::from_rotation_arc(up, DVec3::Z)))
}

/// Returns the input in another frame.
pub fn turned(input: &FitInput, turn: DMat3) -> FitInput {
    let mut input = input.clone();
    for view in &mut input.views {
        view.camera.rotation = turn * view.camera.rotation;
        view.camera.position = turn * view.camera.position;
    }
    input.points.iter_mut().for_each(|point| *point = turn * *point);
    input
}

/// Returns a rotation followed by a shift as a matrix, row by row.
pub fn matrix(turn: DMat3, shift: DVec3) -> [[f64; 4]; 4] {
    let row = |at: usize| [turn.x_axis[at], turn.y_axis[at], turn.z_axis[at], shift[at]];
    [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
}
