//! Activations: from the sum of spherical harmonics to radiance.

use serde::{Deserialize, Serialize};

/// The function that maps the sum of spherical harmonics to radiance.
///
/// It depends on how the field was trained. Packed fields record it; `.npz` files do not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(
    feature = "bevy",
    derive(bevy_reflect::Reflect),
    reflect(Clone, Debug, PartialEq, Hash),
    type_path = "plenoctree"
)]
pub enum Activation {
    /// `1 / (1 + exp(-x))`, as in PlenOctrees. The default for every spherical-harmonic basis.
    Sigmoid,
    /// `max(x + 0.5, 0)`, as in fields converted from Plenoxels (svox2).
    ShiftedRelu,
    /// `x`, the default for RGBA fields, which store their colors directly.
    Identity,
}

impl Activation {
    /// Returns the radiance (encoded sRGB, where 1 is white) for the sum `x`.
    pub fn apply(self, x: f64) -> f64 {
        match self {
            Self::Sigmoid => 1.0 / (1.0 + (-x).exp()),
            Self::ShiftedRelu => (x + 0.5).max(0.0),
            Self::Identity => x,
        }
    }

    /// Returns the sum that produces `radiance` (encoded sRGB), for baking.
    ///
    /// A sigmoid never reaches 0 or 1, so [`Self::Sigmoid`] first clamps `radiance` to the range 0.001 to 0.999.
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
