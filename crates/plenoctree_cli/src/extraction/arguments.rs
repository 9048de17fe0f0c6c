//! The arguments for extraction.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use plenoctree::{
    palette::{Colors, ExtractionSettings, PaletteMethod},
    sampling::SamplingSettings,
};

/// The arguments of every command that extracts a palette.
#[derive(Args)]
pub struct ExtractionArguments {
    /// How the palette is found.
    #[arg(long, value_enum, default_value_t)]
    method: Method,
    /// The largest number of colors, 1 to 64, or `auto` for as few as keep the error within --tolerance.
    #[arg(long, value_name = "N|auto", default_value = "6", value_parser = parse_colors)]
    colors: Count,
    /// With --colors auto, the largest root mean square difference of a channel between the field's colors and their
    /// labels, above 0 and at most 1; 0.05 by default.
    #[arg(long, requires = "colors", value_parser = parse_fraction)]
    tolerance: Option<f64>,
    /// The fraction of the leaves to sample, above 0 and at most 1.
    #[arg(long, default_value_t = 1.0, value_parser = parse_fraction)]
    sample_fraction: f64,
    /// The file to save the histograms to, as arrays `fine` and `coarse`.
    #[arg(long, value_name = "FILE.npz")]
    pub histograms: Option<PathBuf>,
}

/// How the palette is found.
#[derive(Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub enum Method {
    /// The corners of the simplified convex hull of all colors, as in the paper.
    Hull,
    /// The colors whose labels are nearest to the field's colors.
    #[default]
    Fitted,
}

/// A number of colors, or `None` for `auto`.
type Count = Option<usize>;

/// The sampler of the field's radiance.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Sampling {
    /// Compute shaders.
    #[cfg(feature = "bevy")]
    Gpu,
    /// All CPU cores.
    Cpu,
    /// The float64 reference, on one CPU core.
    Reference,
}

impl ExtractionArguments {
    /// Returns the default settings with the changes from the command line.
    pub fn settings(&self) -> ExtractionSettings {
        let method = match self.method {
            Method::Hull => PaletteMethod::Hull,
            Method::Fitted => PaletteMethod::Fitted,
        };
        let auto = || self.tolerance.map_or(Colors::AUTO, |tolerance| Colors::Auto { tolerance });
        let colors = self.colors.map_or_else(auto, Colors::Fixed);
        let sampling = SamplingSettings { sample_fraction: self.sample_fraction, ..SamplingSettings::default() };
        ExtractionSettings { method, colors, sampling, ..ExtractionSettings::default() }
    }
}

fn parse_colors(text: &str) -> Result<Count, String> {
    if text == "auto" {
        return Ok(None);
    }
    let colors = text.parse().ok().filter(|colors| (1..=64).contains(colors));
    colors.map(Some).ok_or_else(|| "expected a number from 1 to 64, or auto".into())
}

fn parse_fraction(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|fraction| *fraction > 0.0 && *fraction <= 1.0)
        .ok_or_else(|| "expected a number above 0 and at most 1".into())
}
