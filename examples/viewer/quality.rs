//! Quality presets on the command line.

use bevy_plenoctree::QualityPreset;
use clap::ValueEnum;

/// A quality preset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Level {
    /// Exactly as the method specifies.
    #[default]
    Exact,
    /// Hardly distinguishable from exact.
    High,
    /// A compromise for most games.
    Balanced,
    /// For many props, or a slow GPU.
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
