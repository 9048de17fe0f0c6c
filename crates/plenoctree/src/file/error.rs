//! Errors of reading fields.

use std::io;

use crate::{field::InvalidField, sampling::InvalidSetting};

/// An error that occurs when reading a PlenOctree file.
#[derive(Debug, thiserror::Error)]
#[error("{file}: {fault}")]
pub struct ReadError {
    /// Path or label of the file.
    pub file: String,
    /// What is wrong with the file.
    #[source]
    pub fault: ReadFault,
}

impl ReadError {
    /// Creates an error. The names of files may hold control characters, which are replaced: messages are one line.
    pub fn new(file: &str, fault: ReadFault) -> Self {
        Self { file: file.replace(char::is_control, "?"), fault }
    }
}

/// What is wrong with a file. `key` is the name of an array in the archive.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadFault {
    /// The file could not be opened or read, or memory ran out.
    #[error("cannot be read: {0}")]
    Io(#[from] io::Error),
    /// A load setting is out of range.
    #[error(transparent)]
    Setting(#[from] InvalidSetting),
    /// A packed field is truncated, damaged, or of an unknown version.
    #[error("{section}: found {found}, expected {expected}")]
    Packed {
        /// Name of the section, or `header`.
        section: &'static str,
        /// What was found.
        found: String,
        /// What was expected.
        expected: String,
    },
    /// The file is neither a packed field nor a zip archive, is truncated, or has a directory that no `.npz` file would
    /// have.
    #[error("found {found}, expected an npz archive or a packed field")]
    NotAnArchive {
        /// What was found instead.
        found: String,
    },
    /// A required array is missing.
    #[error("{key}: array is missing, expected {expected}")]
    Missing {
        /// Name of the array.
        key: &'static str,
        /// What the array holds.
        expected: &'static str,
    },
    /// The archive member of an array is damaged, or its claimed size is implausible.
    #[error("{key}: found {found}, expected {expected}")]
    Member {
        /// Name of the array.
        key: &'static str,
        /// What was found.
        found: String,
        /// What was expected.
        expected: &'static str,
    },
    /// The element type, such as that of pickled objects, cannot be converted without loss of meaning.
    #[error("{key}: found dtype {found}, expected {expected}")]
    Dtype {
        /// Name of the array.
        key: &'static str,
        /// The dtype, as written in the file.
        found: String,
        /// The supported dtypes.
        expected: &'static str,
    },
    /// The shape is wrong, or does not match the other arrays.
    #[error("{key}: found shape {}, expected {expected}", shape(found))]
    Shape {
        /// Name of the array.
        key: &'static str,
        /// The shape in the file.
        found: Vec<u64>,
        /// The required shape.
        expected: String,
    },
    /// A number or name in the array is out of range.
    #[error("{key}: found {found}, expected {expected}")]
    Value {
        /// Name of the array.
        key: &'static str,
        /// The value, and where it is.
        found: String,
        /// The valid values.
        expected: String,
    },
    /// The leaves hold spherical Gaussians or anisotropic spherical Gaussians, which are not supported.
    #[error(
        "data_format: found {format}, expected RGBA, SH1, SH4, SH9, SH16 or SH25: spherical and anisotropic Gaussians \
         are not supported"
    )]
    Gaussians {
        /// The file's `data_format`.
        format: String,
    },
    /// The `child` array is not a tree. Nodes are numbered as in the file.
    #[error("child: {0}")]
    Tree(#[source] InvalidField),
    /// Each array is valid on its own, but together they do not form a field.
    #[error("{0}")]
    Field(#[source] InvalidField),
}

/// Returns the start of a text from a file, escaped to fit on one line of a message.
pub(super) fn printable(text: &str) -> String {
    text.chars().take(60).flat_map(char::escape_debug).collect()
}

/// Formats a shape for messages. Long shapes are truncated.
fn shape(axes: &[u64]) -> String {
    const SHOWN: usize = 8;
    match axes.get(..SHOWN) {
        Some(first) if axes.len() > SHOWN => format!("{first:?} and {} more axes", axes.len() - SHOWN),
        _ => format!("{axes:?}"),
    }
}

#[cfg(test)]
mod tests {
    use super::shape;

    #[test]
    fn long_shapes_are_truncated() {
        assert_eq!(shape(&[]), "[]");
        assert_eq!(shape(&[2; 8]), "[2, 2, 2, 2, 2, 2, 2, 2]");
        assert_eq!(shape(&[1; 46]), "[1, 1, 1, 1, 1, 1, 1, 1] and 38 more axes");
    }
}
