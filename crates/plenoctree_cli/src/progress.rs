//! Progress bars on standard error. They are shown only in a terminal.

use std::{
    fmt::Write,
    panic,
    sync::{Arc, OnceLock},
    thread,
    time::{Duration, Instant},
};

use indicatif::{HumanDuration, ProgressBar, ProgressState, ProgressStyle};

/// Returns a bar of `length` steps.
pub fn bar(message: &'static str, length: u64, quiet: bool) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    styled(ProgressBar::new(length), "{msg:12} [{bar:40}] {pos}/{len} {eta}", message)
}

/// Returns the result of `work`, which another thread does, so that this one can `show` the progress on a bar.
pub fn watched<T: Send>(bar: &ProgressBar, work: impl FnOnce() -> T + Send, show: impl Fn()) -> T {
    thread::scope(|scope| {
        let worker = scope.spawn(work);
        while !worker.is_finished() {
            show();
            thread::sleep(Duration::from_millis(20));
        }
        bar.finish_and_clear();
        match worker.join() {
            Ok(result) => result,
            Err(message) => panic::resume_unwind(message),
        }
    })
}

/// Returns a bar of `length` steps whose message says what a fit is doing.
pub fn fit_bar(length: u64) -> ProgressBar {
    styled(ProgressBar::new(length), "{msg} [{bar:40}] {percent:>3}% {left} left", "")
}

/// Returns a writer of about how much time is left. `{eta}` goes by the last seconds, but fits pause to remove what is
/// not seen, and resume with a part done.
fn left() -> impl Fn(&ProgressState, &mut dyn Write) + Clone + Send + Sync + 'static {
    let first: Arc<OnceLock<(Instant, f64)>> = Arc::default();
    move |state, line| {
        let done = f64::from(state.fraction());
        let known = (done > 0.0).then(|| first.get_or_init(|| (Instant::now(), done)));
        // A line that cannot be written is not shown.
        let _ = match known {
            Some((start, before)) if done > *before => {
                write!(line, "{:#}", HumanDuration(start.elapsed().mul_f64((1.0 - done) / (done - before))))
            }
            _ => line.write_char('?'),
        };
    }
}

/// Returns a spinner, for work whose progress is unknown.
pub fn spinner(message: &'static str, quiet: bool) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    let spinner = styled(ProgressBar::new_spinner(), "{spinner} {msg}", message);
    spinner.enable_steady_tick(Duration::from_millis(100));
    spinner
}

fn styled(bar: ProgressBar, template: &str, message: &'static str) -> ProgressBar {
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    bar.with_style(style.with_key("left", left())).with_message(message)
}
