//! Progress bars on standard error. They are shown only in a terminal.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

/// Returns a bar of `length` steps.
pub fn bar(message: &'static str, length: u64, quiet: bool) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    styled(ProgressBar::new(length), "{msg:12} [{bar:40}] {pos}/{len} {eta}", message)
}

/// Returns a bar of `length` steps whose message says what a fit is doing.
pub fn fit_bar(length: u64) -> ProgressBar {
    styled(ProgressBar::new(length), "{msg} [{bar:40}] {percent:>3}% {eta} left", "")
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
    bar.with_style(style).with_message(message)
}
