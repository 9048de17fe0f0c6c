//! Sampling on the CPU, without an app.

use std::{sync::Arc, time::Instant};

use plenoctree::{
    PlenOctree,
    palette::{ExtractionSettings, extract_from_samples},
    reference::sample_histograms,
    sampling::{Histograms, Progress, SamplingSettings, View, sample},
};

use super::extracted::Extracted;
use crate::{progress, result::Result};

/// Samples on all cores and shows the progress.
pub fn extract(field: &PlenOctree, settings: &ExtractionSettings, quiet: bool) -> Result<Extracted> {
    let bar = progress::bar("extracting", 100, quiet);
    let progress = settings.progress();
    let sampler = |settings: &SamplingSettings| sample(field, settings, &progress).map_err(|error| error.to_string());
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
    let sampler = |settings: &SamplingSettings| sample_histograms(field, settings).map_err(|error| error.to_string());
    let extracted = sample_and_extract(field, settings, "reference", sampler, &Progress::default())?;
    spinner.finish_and_clear();
    Ok(extracted)
}

fn sample_and_extract(
    field: &PlenOctree,
    settings: &ExtractionSettings,
    sampling_on: &'static str,
    sampler: impl FnOnce(&SamplingSettings) -> Result<Histograms, String>,
    progress: &Progress,
) -> Result<Extracted, String> {
    settings.validate().map_err(|error| error.to_string())?;
    let start = Instant::now();
    let histograms = sampler(&settings.sampling)?;
    let views = View::all(field, &settings.view_rays(field), progress).map_err(|error| error.to_string())?;
    let sampling = start.elapsed().as_secs_f64();
    let extracted = extract_from_samples(&histograms, &views, settings, progress);
    let mut extraction = extracted.map_err(|error| error.to_string())?;
    extraction.report.seconds.sampling = sampling;
    Ok(Extracted { extraction, histograms: Arc::new(histograms), sampling_on })
}
