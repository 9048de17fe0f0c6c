//! What is printed for people.

use std::path::Path;

/// What stands for a value that an empty field does not have.
pub const NONE: &str = "none: the field is empty";

/// The file's name, and under it a line per value.
pub fn table(path: &Path, lines: &[(&str, String)]) -> String {
    let line = |(name, value): &(&str, String)| format!("{name:12}  {value}\n");
    format!("{}\n", path.display()) + &lines.iter().map(line).collect::<String>()
}

/// A number of bytes, in megabytes if there are that many.
pub fn size(bytes: u64) -> String {
    if bytes < 1_000_000 { format!("{bytes} bytes") } else { format!("{:.2} MB", bytes as f64 / 1e6) }
}
