//! The share of a frame that uploads may take.

use bevy::{platform::time::Instant, prelude::*, render::extract_resource::ExtractResource};
use std::time::Duration;

/// The time per frame that uploading fields may take on the render thread.
///
/// Fields, and the levels that cameras request, are prepared in the background, and copied to the GPU in slices of
/// about one mebibyte. At least one slice is copied in every frame. A larger budget lets fields arrive sooner.
///
/// The budget is for 60 frames per second. Frames that take longer get proportionally more, so that fields arrive
/// equally fast. If the GPU is emulated in software, frames get less, because the driver copies every slice once more
/// on the same cores.
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

/// The frame that the budget is for.
const FRAME: Duration = Duration::from_micros(16_667);
/// The number of such frames in the longest one that counts. Apps may pause.
const MOST_FRAMES: f64 = 10.0;
/// The fraction of the budget that is left if the driver copies to system memory. That memory was never used before,
/// which makes the copy several times slower than the one that is measured.
const SHARE_IF_EMULATED: f64 = 0.125;

/// What uploads may still do in this frame.
pub(super) struct Allowance {
    start: Instant,
    budget: Option<Duration>,
    has_worked: bool,
    /// The number of levels that may start to be prepared in the background.
    pub free_threads: usize,
    /// Whether an upload is in progress. The others wait for it, so that they arrive one after another.
    pub is_taken: bool,
}

impl Allowance {
    /// Begins a frame. The last one took `last_frame`.
    pub fn new(budget: UploadBudget, last_frame: Duration, is_emulated: bool, free_threads: usize) -> Self {
        let frames = last_frame.div_duration_f64(FRAME).clamp(1.0, MOST_FRAMES);
        let share = if is_emulated { SHARE_IF_EMULATED * frames } else { frames };
        let scaled = |budget: Duration| Duration::try_from_secs_f64(share * budget.as_secs_f64());
        let budget = budget.0.map(|budget| scaled(budget).unwrap_or(Duration::MAX));
        Self { start: Instant::now(), budget, has_worked: false, free_threads, is_taken: false }
    }

    /// Returns whether there is time left for more work. The first piece is always allowed.
    pub fn allows_more(&mut self) -> bool {
        let is_within = self.budget.is_none_or(|budget| self.start.elapsed() < budget);
        !std::mem::replace(&mut self.has_worked, true) || is_within
    }
}
