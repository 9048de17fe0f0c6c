//! Sampling jobs, which the main world submits to the render world.

use std::{
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use bevy::{prelude::*, render::extract_resource::ExtractResource};
use plenoctree::{
    MAX_DEPTH, PlenOctree,
    palette::ExtractionSettings,
    sampling::{Canceled, Histograms, Lattice, Progress, SamplePoint, SamplingPlan, SamplingSettings, View, ViewRays},
};

use crate::{
    background,
    gpu::{field_bytes, tree_depth},
};

/// An error that prevents sampling on the GPU. The CPU samples the field instead.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum SamplingFailure {
    /// The field or a buffer for sampling does not fit on the GPU.
    #[error("the field or a buffer for sampling does not fit on the GPU")]
    TooLarge,
    /// The pipeline could not be created.
    #[error("the sampling pipeline could not be created: {0}")]
    Pipeline(String),
    /// The samples could not be read back.
    #[error("the samples could not be read back: {0}")]
    Readback(String),
}

/// A field to sample. Shared by both worlds.
pub(crate) struct SamplingJob {
    pub id: AssetId<PlenOctree>,
    pub field: PlenOctree,
    pub settings: ExtractionSettings,
    pub progress: Arc<Progress>,
    /// Twice the center of every sampled leaf, in cells of a tree of depth [`MAX_DEPTH`], and the index of the leaf.
    pub leaves: Vec<[u32; 4]>,
    /// The finest cells of the field, if there are not too many.
    pub lattice: Option<Lattice>,
    /// Unit vectors toward the observers. Those of one cell of directions are next to each other.
    pub observers: Vec<[f32; 4]>,
    /// The rays along which the palette needs to know what is seen.
    pub views: Vec<ViewRays>,
    /// Where in the leaves radiance is sampled.
    pub point: SamplePoint,
    /// An upper bound on the total weight of all samples.
    pub weight_bound: f64,
    state: Mutex<State>,
}

impl Drop for SamplingJob {
    fn drop(&mut self) {
        let cells = self.lattice.as_ref().map_or(0, |lattice| lattice.words.len());
        let bytes = 16 * self.leaves.len() as u64 + 4 * cells as u64 + field_bytes(&self.field);
        background::discard((std::mem::take(&mut self.leaves), self.lattice.take(), self.field.clone()), bytes);
    }
}

/// The samples of a field: its histograms, and what is seen in its views.
pub(crate) type Samples = (Histograms, Vec<View>);

/// The samples of a field as the GPU wrote them.
pub(crate) struct RawSamples {
    /// The bins, two words each, then what rays see, four numbers each.
    pub bytes: Vec<u8>,
    /// The factor that converts integers in the histograms to weights.
    pub unit: f64,
    /// The number of radiance samples.
    pub count: u64,
    pub views: Vec<ViewRays>,
}

impl RawSamples {
    /// Returns the histograms, and what is seen. This takes a while if there are many views.
    pub fn convert(&self, settings: &SamplingSettings, progress: &Progress) -> Result<Samples, SamplingFailure> {
        let (fine_bins, coarse_bins) = (settings.fine_bins, settings.coarse_bins);
        let bins = 8 * (fine_bins.pow(3) + coarse_bins.pow(3));
        let (bins, seen) = self.bytes.split_at(bins);
        let texels: Vec<[f32; 4]> = seen.chunks_exact(16).map(bytemuck::pod_read_unaligned).collect();
        let views = View::from_texels(&self.views, &texels, progress);
        let sums = bins.chunks_exact(8).map(bytemuck::pod_read_unaligned::<u64>);
        let mut fine: Vec<f64> = sums.map(|sum| sum as f64 * self.unit).collect();
        let coarse = fine.split_off(fine_bins.pow(3));
        Histograms::new(fine_bins, fine, coarse_bins, coarse, self.count)
            .map(|histograms| (histograms, views))
            .map_err(|error| SamplingFailure::Readback(error.to_string()))
    }
}

enum State {
    Open,
    Ended(Result<RawSamples, SamplingFailure>),
    Taken,
}

impl SamplingJob {
    /// Prepares the data for the GPU. This takes a while for a large field, so call it in the background.
    pub fn new(
        id: AssetId<PlenOctree>,
        field: PlenOctree,
        settings: ExtractionSettings,
        progress: Arc<Progress>,
    ) -> Result<Self, Canceled> {
        let plan = SamplingPlan::new(&field, &settings.sampling_of(&field), &progress)?;
        let leaves = plan.leaves.into_iter().map(|cell| {
            let center = (2 * cell.corner + cell.size) << (MAX_DEPTH - field.depth());
            if progress.is_canceled() { Err(Canceled) } else { Ok([center.x, center.y, center.z, cell.leaf]) }
        });
        let leaves = leaves.collect::<Result<_, _>>()?;
        let lattice = Lattice::new(&field, tree_depth(&field), &progress)?;
        let observers = plan.observers.into_iter().flatten();
        Ok(Self {
            leaves,
            lattice,
            observers: observers.map(|ray| ray.as_vec3().extend(0.0).to_array()).collect(),
            views: settings.view_rays(&field),
            point: plan.point,
            weight_bound: plan.weight_bound,
            id,
            field,
            settings,
            progress,
            state: Mutex::new(State::Open),
        })
    }

    pub fn end(&self, outcome: Result<RawSamples, SamplingFailure>) {
        *self.state() = State::Ended(outcome);
    }

    pub fn is_open(&self) -> bool {
        !self.progress.is_canceled() && matches!(*self.state(), State::Open)
    }

    /// Takes the outcome, if the job has ended.
    pub fn take_outcome(&self) -> Option<Result<RawSamples, SamplingFailure>> {
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

/// What there is to sample.
#[derive(Resource, Clone, Default, ExtractResource)]
pub(crate) struct SamplingJobs {
    /// The jobs that are waiting or in progress, in the order in which they were requested.
    pub open: Vec<Arc<SamplingJob>>,
    /// The GPU time per frame, or `None` for no limit.
    pub budget: Option<Duration>,
}
