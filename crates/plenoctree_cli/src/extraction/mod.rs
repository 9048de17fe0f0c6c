//! Extracts palettes with the sampler that the command line chooses.

mod arguments;
pub mod cpu;
mod extracted;
#[cfg(feature = "bevy")]
mod gpu;

pub use arguments::{ExtractionArguments, Sampling};
pub use extracted::Extracted;

use std::path::Path;

use plenoctree::{
    PlenOctree,
    palette::{ColorCount, Extraction, ExtractionSettings},
};

use crate::{console, result::Result};

/// Extracts a palette as the command line specifies, writes the histograms if requested, and shows progress unless
/// `quiet`. Errors name the field's file, `path`.
///
/// By default, the GPU samples if there is one and this build supports it, otherwise the CPU.
pub fn extract(
    field: &PlenOctree,
    path: &Path,
    arguments: &ExtractionArguments,
    sampling: Option<Sampling>,
    quiet: bool,
) -> Result<Extracted> {
    let settings = arguments.settings()?;
    let extracted = sample_and_extract(field, &settings, sampling, quiet)
        .map_err(|error| format!("{}: {error}", path.display()))?;
    if let Some(path) = &arguments.histograms {
        extracted.histograms.write(path).map_err(|error| format!("{}: {error}", path.display()))?;
    }
    warn_of_error(path, &settings, &extracted.extraction);
    Ok(extracted)
}

/// Warns if a palette has the largest number of colors and still a larger error than the settings ask for. `path` is
/// the file that the palette is extracted from.
pub fn warn_of_error(path: &Path, settings: &ExtractionSettings, extraction: &Extraction) {
    let error = extraction.report.largest_error;
    if let ColorCount::Auto { tolerance } = settings.colors
        && error > tolerance
    {
        let colors = extraction.palette.colors.len();
        console::complain!(
            "warning: {}: the error of {colors} colors is {error:.4}, more than --tolerance {tolerance}: choose --colors",
            path.display()
        );
    }
}

fn sample_and_extract(
    field: &PlenOctree,
    settings: &ExtractionSettings,
    sampling: Option<Sampling>,
    quiet: bool,
) -> Result<Extracted> {
    match sampling {
        Some(Sampling::Cpu) => cpu::extract(field, settings, quiet),
        Some(Sampling::Reference) if settings.sampling.sample_fraction.is_some_and(|fraction| fraction < 1.0) => {
            Err("--sampling reference samples every leaf: omit --sample-fraction".into())
        }
        Some(Sampling::Reference) => cpu::extract_by_reference(field, settings, quiet),
        #[cfg(feature = "bevy")]
        Some(Sampling::Gpu) => gpu::extract(field, settings, quiet),
        #[cfg(feature = "bevy")]
        None => gpu::extract_or_fall_back(field, settings, quiet),
        #[cfg(not(feature = "bevy"))]
        None => cpu::extract(field, settings, quiet),
    }
}
