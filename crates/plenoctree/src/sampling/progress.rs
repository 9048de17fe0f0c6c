//! Progress and cancellation of sampling and extraction.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Progress of sampling, packing or a whole extraction, shared with other threads, which can also cancel it.
///
/// Share it in an `Arc`, and create a new one each time: by default for sampling or packing, or with
/// `ExtractionSettings::progress` for an extraction.
#[derive(Debug)]
pub struct Progress {
    done: AtomicUsize,
    total: AtomicUsize,
    /// The fraction of the palette that is computed, in units of 1/[`UNITS`].
    computed: AtomicUsize,
    /// The share of sampling in the whole. The rest is that of computing the palette.
    sampling: f32,
    canceled: AtomicBool,
}

/// The units in which the computing of palettes is counted.
const UNITS: f32 = 1e6;

/// An error that occurs when a computation is canceled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("canceled")]
pub struct Canceled;

impl Default for Progress {
    fn default() -> Self {
        Self::new(1.0)
    }
}

impl Progress {
    /// Creates the progress of something of which sampling is this share.
    pub(crate) fn new(sampling: f32) -> Self {
        let [done, total, computed] = std::array::from_fn(|_| AtomicUsize::new(0));
        Self { done, total, computed, sampling, canceled: AtomicBool::new(false) }
    }

    /// Returns the fraction of the work that is done, from 0 to 1.
    pub fn fraction(&self) -> f32 {
        let [done, total, computed] =
            [&self.done, &self.total, &self.computed].map(|count| count.load(Ordering::Relaxed) as f32);
        let sampled = if total == 0.0 { 0.0 } else { done / total };
        self.sampling * sampled + (1.0 - self.sampling) * (computed / UNITS).min(1.0)
    }

    /// Requests cancellation. Every stage of an extraction stops soon after that.
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

    /// Counts a fraction of the palette as computed.
    pub(crate) fn compute(&self, fraction: f32) {
        self.computed.fetch_add((UNITS * fraction) as usize, Ordering::Relaxed);
    }

    /// Counts all of the palette as computed.
    pub(crate) fn finish(&self) {
        self.computed.store(UNITS as usize, Ordering::Relaxed);
    }
}
