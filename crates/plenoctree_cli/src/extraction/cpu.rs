//! Sampling on the CPU, without an app.

use std::sync::Arc;

use plenoctree::{
    PlenOctree,
    palette::{ExtractionSettings, extract_with},
    reference::sample_histograms,
    sampling::{Histograms, Progress, SamplingError, SamplingSettings, sample},
};

use super::extracted::Extracted;
use crate::{progress, result::Result};

/// Samples on all cores and shows the progress.
pub fn extract(field: &PlenOctree, settings: &ExtractionSettings, quiet: bool) -> Result<Extracted> {
    let bar = progress::bar("extracting", 100, quiet);
    let progress = settings.progress();
    let sampler = |settings: &SamplingSettings| sample(field, settings, &progress);
    let work = || sample_and_extract(field, settings, sampling_on(field, settings), sampler, &progress);
    let show = || bar.set_position((100.0 * progress.fraction()) as u64);
    Ok(progress::watched(&bar, work, show)?)
}

/// Returns where the samples are taken: by the CPU, unless the file records them.
fn sampling_on(field: &PlenOctree, settings: &ExtractionSettings) -> &'static str {
    if field.histograms(&settings.sampling).is_some() { "file" } else { "cpu" }
}

/// Samples every leaf with the float64 reference, which does not report its progress.
pub fn extract_by_reference(field: &PlenOctree, settings: &ExtractionSettings, quiet: bool) -> Result<Extracted> {
    let spinner = progress::spinner("extracting", quiet);
    let sampler = |settings: &SamplingSettings| Ok(sample_histograms(field, settings)?);
    let extracted = sample_and_extract(field, settings, "reference", sampler, &Progress::default())?;
    spinner.finish_and_clear();
    Ok(extracted)
}

fn sample_and_extract(
    field: &PlenOctree,
    settings: &ExtractionSettings,
    sampling_on: &'static str,
    sampler: impl FnOnce(&SamplingSettings) -> Result<Histograms, SamplingError>,
    progress: &Progress,
) -> Result<Extracted, String> {
    let (extraction, histograms) =
        extract_with(field, settings, progress, sampler).map_err(|error| error.to_string())?;
    Ok(Extracted { extraction, histograms: Arc::new(histograms), sampling_on })
}
