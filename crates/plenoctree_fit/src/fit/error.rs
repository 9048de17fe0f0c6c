//! Errors of fitting fields.

use std::{
    io,
    path::{Path, PathBuf},
};

use plenoctree::InvalidField;

use crate::file::Fault;

/// An error that occurs when fitting a field.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// A file could not be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The content of a file is not what was expected.
    #[error("{}: {what}: found {found}, expected {expected}", path.display())]
    Found {
        /// Path of the file or folder.
        path: PathBuf,
        /// The part of the file, such as a key.
        what: String,
        /// What was found.
        found: String,
        /// What was expected.
        expected: String,
    },
    /// Each view is valid, but they do not show a common object.
    #[error("the views: found {found}, expected {expected}")]
    Views {
        /// What was found.
        found: String,
        /// What was expected.
        expected: &'static str,
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
    /// Nothing is left: every voxel turned out to be empty.
    #[error("nothing is left of the field: every cell turned out to be empty")]
    Empty,
    /// The fit was stopped before there was any result.
    #[error("stopped before training started")]
    Stopped,
    /// The fitted values do not form a field.
    #[error(transparent)]
    Field(#[from] InvalidField),
}

impl FitError {
    /// Returns a closure that names the file of an error.
    pub(super) fn io(path: &Path) -> impl FnOnce(io::Error) -> Self + '_ {
        move |source| Self::Io { path: path.into(), source }
    }

    /// Returns a closure that names the file of a fault in its content.
    pub(super) fn fault(path: &Path) -> impl FnOnce(Fault) -> Self + '_ {
        move |Fault { what, found, expected }| Self::found(path, what, found, expected)
    }

    pub(super) fn found(
        path: &Path,
        what: impl Into<String>,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> Self {
        let [what, found, expected] =
            [what.into(), found.into(), expected.into()].map(|text| text.replace(char::is_control, "?"));
        Self::Found { path: path.into(), what, found, expected }
    }
}
