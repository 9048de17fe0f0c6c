//! Errors of capturing frames.

use std::time::Duration;

use crate::state::PropError;

/// An error of [`Headless`](super::Headless).
#[derive(Debug, thiserror::Error)]
pub enum HeadlessError {
    /// There is no graphics adapter, not even a software one.
    #[error("no usable graphics adapter (install a Vulkan driver, such as Mesa's lavapipe): {0}")]
    NoAdapter(String),
    /// A prop or a posterized view cannot be drawn as it should be, or nothing can be drawn.
    #[error(transparent)]
    Prop(PropError),
    /// The time limit was exceeded.
    #[error("timed out after waiting {limit:?} for {waiting_for}")]
    TimedOut {
        /// The time limit.
        limit: Duration,
        /// What was not ready.
        waiting_for: String,
    },
    /// The frame could not be read back from the GPU.
    #[error("failed to read the frame back: {0}")]
    Readback(String),
}
