//! Progress and cancellation of sampling and extraction.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Progress of an extraction, shared with other threads, which can also cancel it.
///
/// Share it in an `Arc`, and create a new one for each extraction.
#[derive(Debug, Default)]
pub struct Progress {
    done: AtomicUsize,
    total: AtomicUsize,
    canceled: AtomicBool,
}

/// An error that occurs when a computation is canceled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("canceled")]
pub struct Canceled;

impl Progress {
    /// Returns the fraction of the leaves that have been sampled, 0 to 1. Sampling is nearly all the work of an
    /// extraction.
    pub fn fraction(&self) -> f32 {
        let total = self.total.load(Ordering::Relaxed);
        if total == 0 { 0.0 } else { self.done.load(Ordering::Relaxed) as f32 / total as f32 }
    }

    /// Requests cancellation. Every stage of an extraction stops within 50 milliseconds.
    pub fn cancel(&self) {
        self.canceled.store(true, Ordering::Relaxed);
    }

    /// Returns whether [`Self::cancel`] was called.
    pub fn is_canceled(&self) -> bool {
        self.canceled.load(Ordering::Relaxed)
    }

    /// Returns an error if [`Self::cancel`] was called. It is cheap enough to be called for every leaf or color.
    pub(crate) fn check(&self) -> Result<(), Canceled> {
        if self.is_canceled() { Err(Canceled) } else { Ok(()) }
    }

    /// Starts counting: `total` leaves will be sampled. Samplers call this once.
    pub fn begin(&self, total: usize) {
        self.done.store(0, Ordering::Relaxed);
        self.total.store(total, Ordering::Relaxed);
    }

    /// Counts `leaves` more leaves as sampled. Samplers call this as they go.
    pub fn advance(&self, leaves: usize) {
        self.done.fetch_add(leaves, Ordering::Relaxed);
    }
}
