//! Settings for loading fields.

use arbitrary::Arbitrary;
use plenoctree::{Activation, LoadSettings, UpAxis};

/// [`LoadSettings`], and whether to extract a palette.
#[derive(Arbitrary, Clone, Copy, Debug)]
pub struct Settings {
    activation: u8,
    y_up: bool,
    density_threshold: f32,
    /// Whether to also extract a palette.
    pub extract: bool,
}

impl Settings {
    pub fn load(&self) -> LoadSettings {
        LoadSettings {
            activation: match self.activation % 4 {
                0 => None,
                1 => Some(Activation::Sigmoid),
                2 => Some(Activation::ShiftedRelu),
                _ => Some(Activation::Identity),
            },
            up: Some(if self.y_up { UpAxis::Y } else { UpAxis::Z }),
            density_threshold: self.density_threshold,
            ..Default::default()
        }
    }
}
