//! Progress of a fit, and stopping it.

use std::sync::{
    Mutex, PoisonError,
    atomic::{AtomicBool, Ordering},
};

/// The status of a fit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FitStatus {
    /// The current stage, such as `128^3`.
    pub stage: String,
    /// Fraction of the fit that is done, 0 to 1.
    pub fraction: f64,
    /// Mean PSNR of the held-out views so far, in decibels, from some of their pixels.
    pub psnr: Option<f64>,
    /// What the last round of [refining](crate::refine()) gained, in decibels.
    pub gain: Option<f64>,
}

/// Progress of a fit, shared with other threads, which can also stop it.
#[derive(Debug, Default)]
pub struct FitProgress {
    status: Mutex<FitStatus>,
    stopped: AtomicBool,
}

impl FitProgress {
    /// Returns the status of the fit.
    pub fn status(&self) -> FitStatus {
        self.status.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Requests an early end. Once training has begun, the fit returns its current result within seconds, after it has
    /// measured it.
    pub fn stop(&self) {
        self.stopped.store(true, Ordering::Relaxed);
    }

    /// Returns whether [`Self::stop`] was called.
    pub fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }

    pub(super) fn update(&self, change: impl FnOnce(&mut FitStatus)) {
        change(&mut self.status.lock().unwrap_or_else(PoisonError::into_inner));
    }
}
