//! Presets on the command line.

use bevy_plenoctree::Preset;
use clap::ValueEnum;

/// How exactly to draw.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Level {
    /// What the method asks for.
    #[default]
    Exact,
    /// Hardly to be told from it.
    High,
    /// For most games.
    Balanced,
    /// For many props, or little of a graphics card.
    Fast,
}

impl Level {
    pub fn preset(self) -> Preset {
        match self {
            Self::Exact => Preset::Exact,
            Self::High => Preset::High,
            Self::Balanced => Preset::Balanced,
            Self::Fast => Preset::Fast,
        }
    }
}
