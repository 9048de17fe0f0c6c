//! From the sum of spherical harmonics to radiance.

use serde::{Deserialize, Serialize};

/// How the sum of spherical harmonics becomes radiance. A file does not say; whoever trained the field knows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(
    feature = "bevy",
    derive(bevy_reflect::Reflect),
    reflect(Clone, Debug, PartialEq, Hash),
    type_path = "plenoctree"
)]
pub enum Activation {
    /// `1 / (1 + exp(-x))`: PlenOctrees, and the default for every SH basis.
    Sigmoid,
    /// `max(x + 0.5, 0)`: fields converted from Plenoxels (svox2).
    ShiftedRelu,
    /// `x`: the default for RGBA fields, whose colors are stored as they are.
    Identity,
}

impl Activation {
    /// Radiance (encoded sRGB, 1 is white) for the sum `x`.
    pub fn apply(self, x: f64) -> f64 {
        match self {
            Self::Sigmoid => 1.0 / (1.0 + (-x).exp()),
            Self::ShiftedRelu => (x + 0.5).max(0.0),
            Self::Identity => x,
        }
    }

    /// The sum that gives `radiance`, for baking. A sigmoid never reaches 0 or 1, so radiance is kept 1e-3 away from
    /// both there.
    pub fn invert(self, radiance: f64) -> f64 {
        match self {
            Self::Sigmoid => {
                let radiance = radiance.clamp(1e-3, 1.0 - 1e-3);
                (radiance / (1.0 - radiance)).ln()
            }
            Self::ShiftedRelu => radiance - 0.5,
            Self::Identity => radiance,
        }
    }
}
