//! `info`: what a field or a palette holds.

mod arguments;
mod field;
mod palette;
mod text;

pub use arguments::Arguments;

use std::{fs, path::Path};

use serde_json::Value;

use crate::Result;

/// What there is to say about a file, in both forms.
struct Report {
    /// For people.
    text: String,
    /// For programs.
    json: Value,
}

/// Prints what the file holds.
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

/// Whether a file is a palette by its name.
fn is_json(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"))
}

/// The size of a file in bytes.
fn file_size(path: &Path) -> Result<u64> {
    Ok(fs::metadata(path).map_err(|error| format!("{}: {error}", path.display()))?.len())
}
