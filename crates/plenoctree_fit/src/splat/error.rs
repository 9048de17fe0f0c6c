//! Errors of captures.

use std::io;

use plenoctree::InvalidField;

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

/// An error in the content of a file, before the name of the file is known.
#[derive(Debug)]
pub(super) enum Fault {
    Io(io::Error),
    Found { what: String, found: String, expected: String },
}

impl Fault {
    pub fn found(what: impl Into<String>, found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::Found { what: printable(&what.into()), found: printable(&found.into()), expected: expected.into() }
    }

    /// Adds the name of the file.
    pub fn of(self, file: &str) -> SplatError {
        let file = printable(file);
        match self {
            Self::Io(source) => SplatError::Io { file, source },
            Self::Found { what, found, expected } => SplatError::Found { file, what, found, expected },
        }
    }
}

impl From<io::Error> for Fault {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

/// Fits the start of a text from a file on one line of a message.
fn printable(text: &str) -> String {
    const LONGEST: usize = 200;
    text.replace(char::is_control, "?").chars().take(LONGEST).collect()
}
