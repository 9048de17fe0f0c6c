//! Presets on the command line.

use bevy_plenoctree::QualityPreset;
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
    pub fn preset(self) -> QualityPreset {
        match self {
            Self::Exact => QualityPreset::Exact,
            Self::High => QualityPreset::High,
            Self::Balanced => QualityPreset::Balanced,
            Self::Fast => QualityPreset::Fast,
        }
    }
}
