//! Whether everything that a frame needs is ready.

use bevy::{platform::collections::HashSet, prelude::*};

use super::layout::TreeShape;

/// What views found when they planned their frames.
#[derive(Resource, Default)]
pub(crate) struct Readiness {
    /// The shapes of fields whose pipelines are not ready.
    pub waiting: HashSet<TreeShape>,
    /// What views left out because its pipeline was not ready.
    pub left_out: LeftOut,
}

/// What a frame is drawn without.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum LeftOut {
    /// The frame is complete.
    #[default]
    Nothing,
    /// Custom stages whose shaders are wrong.
    Stages,
    /// Props, or something that they need.
    More,
}
