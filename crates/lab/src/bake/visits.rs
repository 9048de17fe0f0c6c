//! The progress of baking: which blocks of the box it has visited.

use std::sync::atomic::{AtomicBool, Ordering};

use indicatif::ProgressBar;

/// Counts blocks on a progress bar when they are first visited, from any thread.
pub struct Visits<'a> {
    visited: Vec<AtomicBool>,
    bar: &'a ProgressBar,
}

impl<'a> Visits<'a> {
    /// Expects visits to the blocks that are true in `expected`.
    pub fn new(expected: &[bool], bar: &'a ProgressBar) -> Self {
        bar.set_length(expected.iter().filter(|expected| **expected).count() as u64);
        Self { visited: expected.iter().map(|_| AtomicBool::new(false)).collect(), bar }
    }

    /// Counts a block, unless it was counted before.
    pub fn mark(&self, block: usize) {
        let visited = &self.visited[block];
        // Nearly all calls end after the load, which does not make cores wait for each other.
        if !visited.load(Ordering::Relaxed) && !visited.swap(true, Ordering::Relaxed) {
            self.bar.inc(1);
        }
    }
}
