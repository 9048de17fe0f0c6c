//! How far a computation is, and whether it should go on.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Tells other threads how far sampling is, and sampling whether to stop. Share it in an `Arc`; use a new one for each
/// extraction.
#[derive(Debug, Default)]
pub struct Progress {
    done: AtomicUsize,
    total: AtomicUsize,
    canceled: AtomicBool,
}

/// The computation was canceled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("canceled")]
pub struct Canceled;

impl Progress {
    /// The share of the leaves that is sampled, 0 to 1. Sampling is nearly all the work of an extraction.
    pub fn fraction(&self) -> f32 {
        let total = self.total.load(Ordering::Relaxed);
        if total == 0 { 0.0 } else { self.done.load(Ordering::Relaxed) as f32 / total as f32 }
    }

    /// Asks the computation to stop. It will within milliseconds.
    pub fn cancel(&self) {
        self.canceled.store(true, Ordering::Relaxed);
    }

    /// Whether [`Self::cancel`] was called.
    pub fn is_canceled(&self) -> bool {
        self.canceled.load(Ordering::Relaxed)
    }

    /// Starts to count: `total` leaves are to be sampled.
    pub fn begin(&self, total: usize) {
        self.done.store(0, Ordering::Relaxed);
        self.total.store(total, Ordering::Relaxed);
    }

    /// Counts leaves that have been sampled.
    pub fn advance(&self, leaves: usize) {
        self.done.fetch_add(leaves, Ordering::Relaxed);
    }
}
