//! Boxes in the frame of the input, which may be turned.

use glam::{DMat3, DVec3};

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
