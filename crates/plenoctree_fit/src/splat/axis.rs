//! Directions along the axes of a capture.

use std::fmt;

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A direction along an axis of a capture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Axis {
    /// Against y: up in the `.ply` files of most trainers. The default.
    #[default]
    NegativeY,
    /// Along y.
    Y,
    /// Against z.
    NegativeZ,
    /// Along z.
    Z,
    /// Against x.
    NegativeX,
    /// Along x.
    X,
}

impl Axis {
    /// All directions.
    pub const ALL: [Self; 6] = [Self::NegativeY, Self::Y, Self::NegativeZ, Self::Z, Self::NegativeX, Self::X];

    /// Returns its name, such as `-y`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::X => "x",
            Self::NegativeX => "-x",
            Self::Y => "y",
            Self::NegativeY => "-y",
            Self::Z => "z",
            Self::NegativeZ => "-z",
        }
    }

    /// Returns the unit vector.
    pub fn direction(self) -> DVec3 {
        match self {
            Self::X => DVec3::X,
            Self::NegativeX => DVec3::NEG_X,
            Self::Y => DVec3::Y,
            Self::NegativeY => DVec3::NEG_Y,
            Self::Z => DVec3::Z,
            Self::NegativeZ => DVec3::NEG_Z,
        }
    }

    /// Returns the axis that is nearest to a direction, or `None` if it is not one.
    pub(super) fn nearest(direction: DVec3) -> Option<Self> {
        let length = |axis: &Self| axis.direction().dot(direction);
        let nearest = Self::ALL.into_iter().max_by(|a, b| length(a).total_cmp(&length(b)))?;
        (direction.is_finite() && length(&nearest) > 0.0).then_some(nearest)
    }
}

impl fmt::Display for Axis {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(self.name())
    }
}
