//! Sampling plans, for samplers on the GPU.

use glam::DVec3;

use super::{
    directions::observers,
    leaves::{chosen_leaves, weight_bound},
    progress::{Canceled, Progress},
    sample_point::SamplePoint,
};
use crate::field::{LeafCell, PlenOctree};
use crate::histograms::SamplingSettings;

/// The radiance samples that [`sample`](super::sample) takes of a field, for samplers that run elsewhere, such as on
/// the GPU.
#[derive(Clone, Debug)]
pub struct SamplingPlan {
    /// Leaves to sample, in the order of the octree.
    pub leaves: Vec<LeafCell>,
    /// Unit vectors from every leaf to the observers, in the field's frame, grouped by direction cell.
    pub observers: Vec<Vec<DVec3>>,
    /// Where in the leaves radiance is sampled.
    pub point: SamplePoint,
    /// Upper bound of the total weight of all samples.
    pub weight_bound: f64,
}

impl SamplingPlan {
    /// Plans the sampling of a field.
    ///
    /// This visits every leaf, so it takes a while for a large field. The settings must be valid: see
    /// [`SamplingSettings::validate`].
    ///
    /// # Errors
    ///
    /// Returns an error if [`Progress::cancel`] is called.
    pub fn new(field: &PlenOctree, settings: &SamplingSettings, progress: &Progress) -> Result<Self, Canceled> {
        let point = SamplePoint::choose(field, settings, progress)?;
        Ok(Self {
            leaves: chosen_leaves(field, settings, progress)?,
            observers: observers(field.up(), settings),
            weight_bound: weight_bound(field, settings, point, progress)?,
            point,
        })
    }
}
