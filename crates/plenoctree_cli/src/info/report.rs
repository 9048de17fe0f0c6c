//! The description of a file.

use std::path::Path;

use serde_json::Value;

/// The description of a file, in both formats.
pub struct Report {
    /// For people.
    pub text: String,
    /// For programs.
    pub json: Value,
}

/// Printed instead of a value that an empty field does not have.
pub const NONE: &str = "none: the field is empty";

/// Returns the name of the file, and below it one line per value.
pub fn table(path: &Path, lines: &[(&str, String)]) -> String {
    let line = |(name, value): &(&str, String)| format!("{name:12}  {value}\n");
    format!("{}\n", path.display()) + &lines.iter().map(line).collect::<String>()
}

/// Formats a number of bytes, in megabytes if it is large enough.
pub fn size(bytes: u64) -> String {
    if bytes < 1_000_000 { format!("{bytes} bytes") } else { format!("{:.2} MB", bytes as f64 / 1e6) }
}
