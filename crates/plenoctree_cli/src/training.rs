//! Runs what takes minutes on another thread, so that this one can show its progress, and ends it early on Ctrl-C.

use std::{
    path::Path,
    process,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

use indicatif::ProgressBar;
use plenoctree_fit::{FitError, FitProgress};

use crate::{console, files, progress, result::Result};

/// Steps of the progress bar.
const STEPS: u64 = 1000;
/// What Ctrl-C says if it ends the program before it is done.
const NOT_DONE: &str = "error: stopped by Ctrl-C before it was done";
/// The exit code of a program that Ctrl-C ended.
const INTERRUPTED: i32 = 130;

/// From now on, work that is divided among threads is divided among this many, or one for each core if it is 0.
pub fn use_threads(threads: u32) -> Result {
    Ok(rayon::ThreadPoolBuilder::new().num_threads(threads as usize).build_global()?)
}

/// What Ctrl-C does.
#[derive(Default)]
pub struct Interruption {
    progress: Arc<FitProgress>,
    has_result: Arc<AtomicBool>,
}

impl Interruption {
    /// From now on, Ctrl-C ends the program with an error, after `clean_up`.
    pub fn new(clean_up: impl Fn() + Send + 'static) -> Result<Self> {
        let interruption = Self::default();
        let end = move || {
            clean_up();
            process::exit(INTERRUPTED)
        };
        let (progress, has_result) = (interruption.progress.clone(), interruption.has_result.clone());
        ctrlc::set_handler(move || {
            if !has_result.load(Ordering::Relaxed) {
                console::complain!("{NOT_DONE}");
                end();
            }
            // Who asks twice does not want to wait.
            if progress.is_stopped() {
                end();
            }
            progress.stop();
            console::complain!(
                "stopped by Ctrl-C: writing the result so far, if there is one (Ctrl-C again ends at once)"
            );
        })?;
        Ok(interruption)
    }

    /// From now on, there is a result to keep: Ctrl-C ends the work early, and asked twice, the program.
    pub fn keep_result(&self) {
        self.has_result.store(true, Ordering::Relaxed);
    }

    /// Returns whether the work is to end early.
    pub fn is_requested(&self) -> bool {
        self.progress.is_stopped()
    }

    /// Returns the result of `work`. Ctrl-C ends it early. Errors about all views, or about an empty result, name the
    /// input.
    pub fn watched<T: Send>(
        &self,
        input: &Path,
        work: impl FnOnce(&FitProgress) -> Result<T, FitError> + Send,
    ) -> Result<T> {
        self.keep_result();
        let bar = progress::fit_bar(STEPS);
        let result = progress::watched(&bar, || work(&self.progress), || show(&bar, &self.progress));
        result.map_err(|error| match error {
            FitError::Stopped => {
                console::complain!("{NOT_DONE}");
                files::clean_up();
                process::exit(INTERRUPTED)
            }
            FitError::Views { .. } | FitError::Empty => format!("{}: {error}", input.display()).into(),
            error => error.into(),
        })
    }
}

fn show(bar: &ProgressBar, progress: &FitProgress) {
    let status = progress.status();
    let psnr = status.psnr.map_or(String::new(), |psnr| format!("{psnr:.1} dB"));
    let gain = status.gain.map_or(String::new(), |gain| format!("{gain:+.2} dB a round "));
    let stage = if progress.is_stopped() { "stopping".into() } else { status.stage };
    bar.set_message(format!("{stage:10} {psnr:8}{gain}"));
    bar.set_position((STEPS as f64 * status.fraction) as u64);
}
