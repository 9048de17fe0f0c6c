//! The arguments for extraction.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use plenoctree::{
    palette::{ColorCount, ExtractionSettings, PaletteMethod},
    sampling::SamplingSettings,
};

use crate::names::one_of;

/// The arguments of every command that extracts a palette.
#[derive(Args, Clone)]
pub struct ExtractionArguments {
    /// How the palette is found: `hull`, the corners of the simplified convex hull of all colors, as in the paper;
    /// `fitted`, the colors whose labels are nearest to the field's colors; or `tones`, as many colors as the field
    /// needs without blends, in ramps by material. By default `tones`; with `stylize --look paper`, `hull`.
    #[arg(long, value_parser = one_of(PaletteMethod::ALL, PaletteMethod::name))]
    method: Option<PaletteMethod>,
    /// The maximum number of colors, 1 to 64, or `auto` for the fewest that keep the error within --tolerance; by
    /// default 6, or as many tones as the field needs. A hull has at least 4.
    #[arg(long, value_name = "N|auto", value_parser = parse_colors)]
    colors: Option<ColorCount>,
    /// With --colors auto, the largest root mean square difference of a channel between the field's colors and their
    /// labels, above 0 and at most 1; 0.05 by default.
    #[arg(long, requires = "colors", value_parser = parse_fraction)]
    tolerance: Option<f64>,
    /// The fraction of the leaves to sample, above 0 and at most 1. By default 1; for tones without a tolerance, which do
    /// not depend on it, as many as say how well the field is shown, unless --histograms are saved.
    #[arg(long, value_parser = parse_fraction)]
    sample_fraction: Option<f64>,
    /// The file to save the histograms to, as arrays `fine` and `coarse`. Its name must end in .npz.
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
    /// Returns these arguments with another method by default.
    pub fn by_default(&self, method: PaletteMethod) -> Self {
        Self { method: self.method.or(Some(method)), ..self.clone() }
    }

    /// Returns the default settings with the changes from the command line. Checks that the histograms do not replace
    /// something else.
    pub fn settings(&self) -> Result<ExtractionSettings, String> {
        if let Some(file) = self
            .histograms
            .as_ref()
            .filter(|file| file.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("npz")))
        {
            return Err(format!("{}: the name of the histograms must end in .npz", file.display()));
        }
        let colors = match (self.colors.unwrap_or_default(), self.tolerance) {
            (ColorCount::Fixed(colors), Some(_)) => {
                return Err(format!("--tolerance only applies to --colors auto, but found --colors {colors}"));
            }
            (_, Some(tolerance)) => ColorCount::Auto { tolerance },
            (colors, None) => colors,
        };
        let method = self.method.unwrap_or_default();
        let sample_fraction = self.sample_fraction.or(self.histograms.is_some().then_some(1.0));
        let sampling = SamplingSettings { sample_fraction, ..SamplingSettings::default() };
        Ok(ExtractionSettings { method, colors, sampling, ..ExtractionSettings::default() })
    }
}

fn parse_colors(text: &str) -> Result<ColorCount, String> {
    if text == "auto" {
        return Ok(ColorCount::AUTO);
    }
    let colors = text.parse().ok().filter(|colors| (1..=64).contains(colors));
    colors.map(ColorCount::Fixed).ok_or_else(|| "expected a number from 1 to 64, or auto".into())
}

fn parse_fraction(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|fraction| *fraction > 0.0 && *fraction <= 1.0)
        .ok_or_else(|| "expected a number above 0 and at most 1".into())
}
