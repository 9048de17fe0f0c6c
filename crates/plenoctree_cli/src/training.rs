//! Runs what takes minutes on another thread, so that this one can show its progress.

use std::{sync::Arc, thread, time::Duration};

use indicatif::ProgressBar;
use plenoctree::fit::{FitError, FitProgress};

use crate::{progress, result::Result};

/// Steps of the progress bar.
const STEPS: u64 = 1000;

/// Returns the result of `work`, which runs on `threads` threads, or one for each core if that is 0. Ctrl-C ends it
/// early.
pub fn watched<T: Send + 'static>(
    threads: u32,
    work: impl FnOnce(&FitProgress) -> Result<T, FitError> + Send + 'static,
) -> Result<T> {
    let progress = Arc::new(FitProgress::default());
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads as usize).build()?;
    {
        let progress = progress.clone();
        ctrlc::set_handler(move || {
            // Who asks twice does not want to wait.
            if progress.is_stopped() {
                std::process::exit(130);
            }
            progress.stop();
        })?;
    }
    let worker = {
        let progress = progress.clone();
        thread::spawn(move || pool.install(|| work(&progress)))
    };
    let bar = progress::fit_bar(STEPS);
    while !worker.is_finished() {
        show(&bar, &progress);
        thread::sleep(Duration::from_millis(100));
    }
    bar.finish_and_clear();
    Ok(worker.join().map_err(|_| "the fit stopped unexpectedly")??)
}

fn show(bar: &ProgressBar, progress: &FitProgress) {
    let status = progress.status();
    let psnr = status.psnr.map_or(String::new(), |psnr| format!("{psnr:.1} dB"));
    let stage = if progress.is_stopped() { "stopping".into() } else { status.stage };
    bar.set_message(format!("{stage:10} {psnr:8}"));
    bar.set_position((STEPS as f64 * status.fraction) as u64);
}
