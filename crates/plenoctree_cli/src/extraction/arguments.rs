//! The arguments for extraction.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use plenoctree::{palette::ExtractionSettings, sampling::SamplingSettings};

/// The arguments of every command that extracts a palette.
#[derive(Args)]
pub struct ExtractionArguments {
    /// The number of colors to simplify the palette to.
    #[arg(long, default_value_t = 6, value_parser = clap::value_parser!(u32).range(1..=64))]
    colors: u32,
    /// The fraction of the leaves to sample, above 0 and at most 1.
    #[arg(long, default_value_t = 1.0, value_parser = parse_fraction)]
    sample_fraction: f64,
    /// The file to save the histograms to, as arrays `fine` and `coarse`.
    #[arg(long, value_name = "FILE.npz")]
    pub histograms: Option<PathBuf>,
}

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
        let sampling = SamplingSettings { sample_fraction: self.sample_fraction, ..SamplingSettings::default() };
        ExtractionSettings { colors: self.colors as usize, sampling, ..ExtractionSettings::default() }
    }
}

fn parse_fraction(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|fraction| *fraction > 0.0 && *fraction <= 1.0)
        .ok_or_else(|| "expected a number above 0 and at most 1".into())
}
