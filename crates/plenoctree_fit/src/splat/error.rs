//! Errors of captures.

use std::io;

use plenoctree::InvalidField;

use crate::file::{Fault, printable};

/// An error that occurs when reading a capture or converting it to a field.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SplatError {
    /// A file could not be read.
    #[error("{file}: cannot be read: {source}")]
    Io {
        /// Path or label of the file.
        file: String,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The content of a file is not what was expected.
    #[error("{file}: {what}: found {found}, expected {expected}")]
    Found {
        /// Path or label of the file.
        file: String,
        /// The part of the file, such as a property.
        what: String,
        /// What was found.
        found: String,
        /// What was expected.
        expected: String,
    },
    /// A setting is out of range.
    #[error("{setting}: found {found}, expected {expected}")]
    Setting {
        /// Name of the setting.
        setting: &'static str,
        /// The value.
        found: String,
        /// The valid values.
        expected: &'static str,
    },
    /// No Gaussian is left to convert to a field.
    #[error("nothing is left of the capture: found no visible Gaussian in {place}, expected at least one")]
    Empty {
        /// Where they were searched for.
        place: String,
    },
    /// The cells do not form a field.
    #[error(transparent)]
    Field(#[from] InvalidField),
}

impl Fault {
    /// Adds the name of the file.
    pub(super) fn of(self, file: &str) -> SplatError {
        let Self { what, found, expected } = self;
        SplatError::Found { file: printable(file), what, found, expected }
    }
}
