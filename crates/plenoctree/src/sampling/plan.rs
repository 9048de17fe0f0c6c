//! What a GPU needs to know to sample a field.

use glam::DVec3;

use super::{
    directions::observers,
    leaves::{chosen_leaves, weight_bound},
    settings::SamplingSettings,
};
use crate::field::{LeafCell, PlenOctree};

/// Which radiance samples [`sample`](super::sample) takes of a field, for samplers that run elsewhere, such as on a GPU.
#[derive(Clone, Debug)]
pub struct SamplingPlan {
    /// The leaves that are sampled, in the order of the octree.
    pub leaves: Vec<LeafCell>,
    /// Unit vectors from every leaf to the observers, in the field's frame, grouped by cell of directions.
    pub observers: Vec<Vec<DVec3>>,
    /// An upper bound of the total weight of all samples.
    pub weight_bound: f64,
}

impl SamplingPlan {
    /// Plans the sampling of a field. Visits every leaf, so a large field takes a moment.
    pub fn new(field: &PlenOctree, settings: &SamplingSettings) -> Self {
        Self {
            leaves: chosen_leaves(field, settings),
            observers: observers(field.up(), settings),
            weight_bound: weight_bound(field, settings),
        }
    }
}
