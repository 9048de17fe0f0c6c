//! Whether everything that a frame needs is ready.

use bevy::{platform::collections::HashSet, prelude::*};

use super::layout::TreeShape;

/// What views found when they planned their frames.
#[derive(Resource, Default)]
pub(crate) struct Readiness {
    /// The shapes of fields whose pipelines are not ready.
    pub waiting: HashSet<TreeShape>,
    /// Whether no view left anything out because its pipeline was not ready.
    pub is_complete: bool,
}
