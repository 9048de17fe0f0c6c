//! `fit`: fits a field to photographs.

mod arguments;
mod output;

pub use arguments::Arguments;

use std::{sync::Arc, thread, time::Duration};

use indicatif::ProgressBar;
use plenoctree::fit::{FitInput, FitProgress, FitReport, Fitted, fit};

use crate::{Result, extraction, progress};

/// Steps of the progress bar.
const STEPS: u64 = 1000;

/// Fits the field, extracts its palette, and writes both with previews and a report.
pub fn run(arguments: &Arguments) -> Result {
    let folders = arguments.folders();
    let input = FitInput::read(&arguments.input, &folders)?;
    let test = arguments.test.as_deref().map(|path| FitInput::read(path, &folders)).transpose()?;
    output::check(&arguments.out)?;
    let Fitted { field, previews, report } = fit_with_progress(arguments, input, test)?;
    let extracted = extraction::extract(&field, &arguments.out, &arguments.extraction, None, false)?;
    output::write(&arguments.out, &field, &extracted.extraction.palette, &previews, &report)?;
    print(arguments, &report);
    Ok(())
}

/// Fits on another thread so that this one can show the progress. Ctrl-C ends the fit early.
fn fit_with_progress(arguments: &Arguments, input: FitInput, test: Option<FitInput>) -> Result<Fitted> {
    let progress = Arc::new(FitProgress::default());
    let settings = arguments.settings();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(arguments.threads).build()?;
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
        thread::spawn(move || pool.install(|| fit(&input, test.as_ref(), &settings, &progress)))
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

fn print(arguments: &Arguments, report: &FitReport) {
    for view in &report.suspicious {
        eprintln!(
            "warning: view {} ({}) contradicts the others, {:.1} dB where {:.1} dB are usual: its pose may be wrong",
            view.number, view.name, view.psnr_db, view.median_psnr_db
        );
    }
    if let Some(held_out) = &report.held_out {
        println!(
            "{:.2} dB, SSIM {:.3} on {} views that were not fitted to",
            held_out.psnr_db,
            held_out.ssim,
            held_out.views.len()
        );
    }
    let seconds = report.seconds.preparing + report.seconds.training + report.seconds.measuring;
    println!("{}: {} leaves, {seconds:.0} s", arguments.out.display(), report.leaves);
}
