//! Looks by name.

use clap::ValueEnum;
use plenoctree::{palette::PaletteMethod, reference::Posterization};

use crate::renderer::toon;

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

    /// Returns its settings of posterization.
    pub fn posterization(self) -> Posterization {
        match self {
            Self::Paper => Posterization::default(),
            Self::Toon | Self::Comic => toon(),
            Self::Soft => Posterization { softness: 0.12, ..toon() },
        }
    }
}
