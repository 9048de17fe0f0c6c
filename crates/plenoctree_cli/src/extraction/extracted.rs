//! The result of extraction.

use std::sync::Arc;

use plenoctree::{palette::Extraction, sampling::Histograms};

/// A palette, the histograms it was extracted from, and the sampler.
pub struct Extracted {
    /// The palette and details of its extraction.
    pub extraction: Extraction,
    /// The sampled histograms.
    pub histograms: Arc<Histograms>,
    /// The sampler's name: `cpu`, `reference`, `gpu`, or `file` if the file of a packed field records the samples.
    pub sampling_on: &'static str,
}
