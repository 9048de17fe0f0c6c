//! Prints text. Work goes on if nobody reads it, as after `| head`.

use std::{
    io::{self, ErrorKind, Write},
    process::ExitCode,
    sync::OnceLock,
};

use crate::result::Result;

/// Why standard output can no longer be written.
static FAILURE: OnceLock<io::Error> = OnceLock::new();

/// Prints a line to standard output.
#[macro_export]
macro_rules! say {
    ($($part:tt)*) => {
        $crate::console::print(&format!("{}\n", format_args!($($part)*)))
    };
}

/// Prints a line to standard error.
#[macro_export]
macro_rules! complain {
    ($($part:tt)*) => {
        $crate::console::print_error(&format!($($part)*))
    };
}

pub use crate::{complain, say};

/// Prints to standard output. Failures are kept for `check`.
pub fn print(text: &str) {
    if FAILURE.get().is_none() {
        let _ = io::stdout().write_all(text.as_bytes()).map_err(|error| FAILURE.set(error));
    }
}

/// Prints a line to standard error, if possible.
pub fn print_error(text: &str) {
    let _ = writeln!(io::stderr(), "{text}");
}

/// Ends a program: prints the error of its command, if there is one.
pub fn exit(result: Result) -> ExitCode {
    match result.and_then(|()| check()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            complain!("error: {error}");
            ExitCode::from(2)
        }
    }
}

/// Returns an error if something could not be printed, unless the reader has just read enough.
fn check() -> Result {
    let _ = io::stdout().flush().map_err(|error| FAILURE.set(error));
    match FAILURE.get() {
        Some(error) if error.kind() != ErrorKind::BrokenPipe => Err(format!("standard output: {error}").into()),
        _ => Ok(()),
    }
}
