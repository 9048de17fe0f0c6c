//! Looks by name.

use clap::ValueEnum;
use plenoctree::palette::PaletteMethod;

use crate::renderer::Filter;

/// A look, named as in the plugin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum NamedLook {
    /// The paper's: the hull of the colors, and blends that blend into one another.
    Paper,
    /// A cartoon's: tones with smooth lines between them, or hard ones with --renderer reference.
    #[default]
    Toon,
    /// A comic's: those of a cartoon, and ink; not with --renderer reference.
    Comic,
    /// Tones that blend into one another.
    Soft,
}

impl NamedLook {
    /// Returns how palettes are extracted for this look.
    pub fn method(self) -> PaletteMethod {
        match self {
            Self::Paper => PaletteMethod::Hull,
            Self::Toon | Self::Comic | Self::Soft => PaletteMethod::Tones,
        }
    }

    /// Returns the filter that flattens colors.
    pub fn filter(self) -> Filter {
        match self {
            Self::Paper => Filter::PAPER,
            Self::Toon | Self::Comic | Self::Soft => Filter::TONES,
        }
    }

    /// Returns the distance over which its labels blend, in the space of the palette's labels.
    pub fn softness(self) -> f32 {
        match self {
            Self::Paper => 0.2,
            Self::Toon | Self::Comic => 0.0,
            Self::Soft => 0.12,
        }
    }
}
