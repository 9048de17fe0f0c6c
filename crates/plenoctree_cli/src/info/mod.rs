//! `info`: prints what a field or a palette contains.

mod arguments;
mod field;
mod palette;
mod report;

pub use arguments::Arguments;

use std::path::Path;

use crate::{console, result::Result};

/// Prints the description of the file.
pub fn run(arguments: &Arguments) -> Result {
    let path = &arguments.file;
    let report = if is_json(path) { palette::report(path)? } else { field::report(path)? };
    if arguments.json {
        console::say!("{}", serde_json::to_string_pretty(&report.json)?);
    } else {
        console::print(&report.text);
    }
    Ok(())
}

/// Whether a file has the extension of a palette.
fn is_json(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"))
}
