//! Errors of capturing frames.

use std::time::Duration;

use bevy::{
    prelude::*,
    render::error_handler::{RenderError, RenderErrorPolicy},
};

use crate::{gpu::ViewTooLarge, prop::PropError};

/// An error of [`Headless`](super::Headless).
#[derive(Debug, thiserror::Error)]
pub enum HeadlessError {
    /// There is no graphics adapter, not even a software one.
    #[error("no usable graphics adapter (install a Vulkan driver, such as Mesa's lavapipe): {0}")]
    NoAdapter(String),
    /// A prop or a posterized view cannot be drawn as it should be, or nothing can be drawn.
    #[error(transparent)]
    Prop(PropError),
    /// The GPU has too little memory for what a camera needs to draw props.
    #[error(transparent)]
    View(ViewTooLarge),
    /// The GPU reported an error in an earlier frame, and nothing is rendered anymore.
    #[error("rendering failed: {0}")]
    Rendering(String),
    /// The time limit was exceeded.
    #[error("timed out after waiting {limit:?} for {waiting_for}")]
    TimedOut {
        /// The time limit.
        limit: Duration,
        /// What was not ready.
        waiting_for: String,
    },
    /// There are no pointers, because the app does not have Bevy's `DefaultPickingPlugins`.
    #[cfg(feature = "picking")]
    #[error("there are no pointers; add Bevy's `DefaultPickingPlugins`")]
    NoPointers,
    /// The frame could not be read back from the GPU.
    #[error("failed to read the frame back: {0}")]
    Readback(String),
}

/// Why rendering stopped.
#[derive(Resource)]
pub(super) struct RenderingFailure(pub String);

/// Stops rendering, as Bevy's own handler does, but keeps the reason: without a window and a log, nobody would see it.
pub(super) fn keep_failure(error: &RenderError, world: &mut World, _: &mut World) -> RenderErrorPolicy {
    let reason = format!("{:?}: {}", error.ty, error.description);
    // Bevy calls it in every frame after that.
    if world.get_resource::<RenderingFailure>().is_none_or(|failure| failure.0 != reason) {
        error!("stopped rendering after an error ({reason})");
    }
    world.insert_resource(RenderingFailure(reason));
    RenderErrorPolicy::StopRendering
}
