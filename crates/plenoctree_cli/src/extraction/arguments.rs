//! The arguments of extraction.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use plenoctree::{palette::ExtractionSettings, sampling::SamplingSettings};

/// What every command that extracts a palette lets the user choose.
#[derive(Args)]
pub struct ExtractionArguments {
    /// Colors that the palette is simplified to.
    #[arg(long, default_value_t = 6, value_parser = clap::value_parser!(u32).range(1..=64))]
    colors: u32,
    /// The share of the leaves that is sampled, above 0 to 1.
    #[arg(long, default_value_t = 1.0, value_parser = parse_fraction)]
    sample_fraction: f64,
    /// Where to write the histograms, as an .npz of `fine` and `coarse`.
    #[arg(long, value_name = "FILE.npz")]
    pub histograms: Option<PathBuf>,
}

/// What samples radiance for the palette.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Sampling {
    /// Compute shaders in the render world.
    #[cfg(feature = "bevy")]
    Gpu,
    /// All cores.
    Cpu,
    /// The float64 reference, on one core.
    Reference,
}

impl ExtractionArguments {
    /// The defaults, with what the command line changes.
    pub fn settings(&self) -> ExtractionSettings {
        let sampling = SamplingSettings { sample_fraction: self.sample_fraction, ..SamplingSettings::default() };
        ExtractionSettings { colors: self.colors as usize, sampling, ..ExtractionSettings::default() }
    }
}

fn parse_fraction(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|fraction| *fraction > 0.0 && *fraction <= 1.0)
        .ok_or_else(|| "expected a number above 0 to 1".into())
}
