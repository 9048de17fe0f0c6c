//! `info`: prints what a field or a palette holds.

mod arguments;
mod field;
mod palette;
mod text;

pub use arguments::Arguments;

use std::{fs, path::Path};

use serde_json::Value;

use crate::Result;

/// The description of a file, in both formats.
struct Report {
    /// For people.
    text: String,
    /// For programs.
    json: Value,
}

/// Prints the description of the file.
pub fn run(arguments: &Arguments) -> Result {
    let path = &arguments.file;
    let report = if is_json(path) { palette::report(path)? } else { field::report(path)? };
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&report.json)?);
    } else {
        print!("{}", report.text);
    }
    Ok(())
}

/// Whether a file has the extension of a palette.
fn is_json(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"))
}

/// Returns the size of a file in bytes.
fn file_size(path: &Path) -> Result<u64> {
    Ok(fs::metadata(path).map_err(|error| format!("{}: {error}", path.display()))?.len())
}
