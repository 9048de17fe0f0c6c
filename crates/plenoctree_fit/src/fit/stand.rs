//! Turns inputs upright, and boxes with them.

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

/// A box along the axes of the input, in the frame to which the input was turned.
#[derive(Clone, Copy, Debug)]
pub struct TurnedBox {
    low: DVec3,
    high: DVec3,
    turn: DMat3,
}

impl TurnedBox {
    /// Creates a box from its corners in the frame of the input, and from how that was turned.
    pub fn new((low, high): (DVec3, DVec3), turn: DMat3) -> Self {
        Self { low, high, turn }
    }

    /// Returns the corners of the box around it.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let (center, half) = (0.5 * (self.low + self.high), 0.5 * (self.high - self.low));
        let (center, half) = (self.turn * center, self.turn.abs() * half);
        (center - half, center + half)
    }

    /// Returns whether a cube around `center` may overlap it. A cube without a size is a point.
    pub fn overlaps(&self, center: DVec3, size: f64) -> bool {
        let to_input = self.turn.transpose();
        let (center, half) = (to_input * center, to_input.abs() * DVec3::splat(0.5 * size));
        (center + half).cmpgt(self.low).all() && (center - half).cmplt(self.high).all()
    }
}

/// Returns a rotation followed by a shift as a matrix, row by row.
pub fn matrix(turn: DMat3, shift: DVec3) -> [[f64; 4]; 4] {
    let row = |at: usize| [turn.x_axis[at], turn.y_axis[at], turn.z_axis[at], shift[at]];
    [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
}
