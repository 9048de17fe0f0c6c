//! What the main world asks the render world for.

use std::{
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use bevy::{prelude::*, render::extract_resource::ExtractResource};
use plenoctree::{
    MAX_DEPTH, PlenOctree,
    palette::ExtractionSettings,
    sampling::{Histograms, Progress, SamplingPlan},
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
    /// Twice the center of every sampled leaf, in cells of the deepest tree that there can be, and its index.
    pub leaves: Vec<[u32; 4]>,
    /// Unit vectors to the observers, those of a cell of directions together.
    pub observers: Vec<[f32; 4]>,
    /// No less than what all samples weigh.
    pub weight_bound: f64,
    state: Mutex<State>,
}

enum State {
    Open,
    Ended(Result<Histograms, SamplingFailure>),
    Taken,
}

impl SamplingJob {
    /// Works out what the GPU needs to know, which takes a while for a large field: call it in a task.
    pub fn new(
        id: AssetId<PlenOctree>,
        field: PlenOctree,
        settings: ExtractionSettings,
        budget: Option<Duration>,
        progress: Arc<Progress>,
    ) -> Self {
        let plan = SamplingPlan::new(&field, &settings.sampling);
        let leaves = plan.leaves.into_iter().map(|cell| {
            let center = (2 * cell.corner + cell.size) << (MAX_DEPTH - field.depth());
            [center.x, center.y, center.z, cell.leaf]
        });
        let observers = plan.observers.into_iter().flatten();
        Self {
            leaves: leaves.collect(),
            observers: observers.map(|ray| ray.as_vec3().extend(0.0).to_array()).collect(),
            weight_bound: plan.weight_bound,
            id,
            field,
            settings,
            budget,
            progress,
            state: Mutex::new(State::Open),
        }
    }

    pub fn end(&self, outcome: Result<Histograms, SamplingFailure>) {
        *self.state() = State::Ended(outcome);
    }

    pub fn is_open(&self) -> bool {
        !self.progress.is_canceled() && matches!(*self.state(), State::Open)
    }

    /// The outcome, once.
    pub fn take_outcome(&self) -> Option<Result<Histograms, SamplingFailure>> {
        let mut state = self.state();
        match std::mem::replace(&mut *state, State::Taken) {
            State::Ended(outcome) => Some(outcome),
            other => {
                *state = other;
                None
            }
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The jobs that wait or are under way, in the order in which they were asked for.
#[derive(Resource, Clone, Default, ExtractResource)]
pub(crate) struct SamplingJobs(pub Vec<Arc<SamplingJob>>);
