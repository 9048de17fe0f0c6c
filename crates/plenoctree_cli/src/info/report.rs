//! The description of a file.

use std::{fs, path::Path};

use serde_json::Value;

use crate::result::Result;

/// The description of a file, in both formats.
pub struct Report {
    /// For people.
    pub text: String,
    /// For programs.
    pub json: Value,
}

/// Returns the size of a file in bytes.
pub fn file_size(path: &Path) -> Result<u64> {
    Ok(fs::metadata(path).map_err(|error| format!("{}: {error}", path.display()))?.len())
}
