//! How much of a frame uploads may take.

use bevy::{platform::time::Instant, prelude::*, render::extract_resource::ExtractResource};
use std::time::Duration;

/// The time of the render thread that uploads of fields may take in a frame.
///
/// Fields, and the levels that cameras request, are prepared in the background, and copied to the GPU in slices of about
/// one mebibyte. At least one slice is copied in every frame. A larger budget lets fields arrive sooner.
///
/// Defaults to 2 ms. With `None`, everything that is ready is copied at once, which is meant for apps without a window.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Eq, ExtractResource, Reflect)]
#[reflect(Resource, Default, Clone, Debug, PartialEq)]
#[type_path = "bevy_plenoctree"]
pub struct UploadBudget(pub Option<Duration>);

impl Default for UploadBudget {
    fn default() -> Self {
        Self(Some(Duration::from_millis(2)))
    }
}

/// What uploads may still do in this frame.
pub(super) struct Turn {
    start: Instant,
    budget: Option<Duration>,
    has_worked: bool,
    /// The number of levels that may start to be prepared in the background.
    pub free_threads: usize,
    /// Whether an upload has begun and has not ended. The others wait for it, so that one after another arrives.
    pub is_taken: bool,
}

impl Turn {
    pub fn new(budget: UploadBudget, free_threads: usize) -> Self {
        Self { start: Instant::now(), budget: budget.0, has_worked: false, free_threads, is_taken: false }
    }

    /// Returns whether there is time left for a piece of work. The first one may always be done.
    pub fn allows_more(&mut self) -> bool {
        let is_within = self.budget.is_none_or(|budget| self.start.elapsed() < budget);
        !std::mem::replace(&mut self.has_worked, true) || is_within
    }
}
