//! What the main world asks the render world for.

use std::{
    sync::{Arc, Mutex, PoisonError},
    time::Duration,
};

use bevy::{prelude::*, render::extract_resource::ExtractResource};

use crate::{
    field::PlenOctree,
    palette::{ExtractionSettings, Histograms, Progress},
};

/// Why the GPU gives no histograms; the CPU does then.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum SamplingFailure {
    /// The field, or what sampling needs beside it, cannot be bound.
    #[error("the GPU cannot bind what sampling needs")]
    TooLarge,
    /// The pipeline could not be made.
    #[error("the sampling pipeline cannot be made: {0}")]
    Pipeline(String),
    /// The result did not come back.
    #[error("the histograms could not be read back: {0}")]
    Readback(String),
}

/// A field to be sampled. Both worlds hold it.
pub(crate) struct SamplingJob {
    pub id: AssetId<PlenOctree>,
    pub field: PlenOctree,
    pub settings: ExtractionSettings,
    /// GPU time a frame; `None` for as much as there is.
    pub budget: Option<Duration>,
    pub progress: Arc<Progress>,
    outcome: Mutex<Option<Result<Histograms, SamplingFailure>>>,
}

impl SamplingJob {
    pub fn new(
        id: AssetId<PlenOctree>,
        field: PlenOctree,
        settings: ExtractionSettings,
        budget: Option<Duration>,
        progress: Arc<Progress>,
    ) -> Self {
        Self { id, field, settings, budget, progress, outcome: Mutex::new(None) }
    }

    pub fn end(&self, outcome: Result<Histograms, SamplingFailure>) {
        *self.outcome.lock().unwrap_or_else(PoisonError::into_inner) = Some(outcome);
    }

    pub fn is_open(&self) -> bool {
        !self.progress.is_cancelled() && self.outcome.lock().unwrap_or_else(PoisonError::into_inner).is_none()
    }

    pub fn take_outcome(&self) -> Option<Result<Histograms, SamplingFailure>> {
        self.outcome.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

/// The jobs that wait or are under way, in the order in which they were asked for.
#[derive(Resource, Clone, Default, ExtractResource)]
pub(crate) struct SamplingJobs(pub Vec<Arc<SamplingJob>>);
