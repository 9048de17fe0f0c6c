//! Why a field could not be read or written.

use std::io;

use crate::field::InvalidField;

/// A file that is not a PlenOctree, or not a whole one: which file, and what is wrong with it.
#[derive(Debug, thiserror::Error)]
#[error("{file}: {fault}")]
pub struct ReadError {
    /// The file's path or label.
    pub file: String,
    /// What is wrong.
    #[source]
    pub fault: ReadFault,
}

impl ReadError {
    pub(super) fn new(file: &str, fault: ReadFault) -> Self {
        let file = file.chars().map(|letter| if letter.is_control() { '?' } else { letter }).collect();
        Self { file, fault }
    }
}

/// What is wrong with a file. `key` names the array of the archive.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadFault {
    /// The file could not be opened or read, or memory ran out.
    #[error("cannot be read: {0}")]
    Io(#[from] io::Error),
    /// The file is not a zip archive, is cut short, or has a directory that no `.npz` has.
    #[error("found {found}, expected an npz archive")]
    NotAnArchive {
        /// What is there instead.
        found: String,
    },
    /// An array without which there is no field is not there.
    #[error("{key}: found no such array, expected {expected}")]
    Missing {
        /// The array.
        key: &'static str,
        /// What it holds.
        expected: &'static str,
    },
    /// An array's place in the archive is damaged, or the size it claims is not credible.
    #[error("{key}: found {found}, expected {expected}")]
    Member {
        /// The array.
        key: &'static str,
        /// What is there.
        found: String,
        /// What should be.
        expected: &'static str,
    },
    /// The elements are of a type that does not convert without loss of meaning. Pickled objects are among these.
    #[error("{key}: found dtype {found}, expected {expected}")]
    Dtype {
        /// The array.
        key: &'static str,
        /// Its dtype, as the file writes it.
        found: String,
        /// The dtypes that are read.
        expected: &'static str,
    },
    /// The shape is not the one that the array must have, or that goes with the other arrays.
    #[error("{key}: found shape {}, expected {expected}", shape(found))]
    Shape {
        /// The array.
        key: &'static str,
        /// Its shape.
        found: Vec<u64>,
        /// The shape that it must have.
        expected: String,
    },
    /// A number or name in the array is outside what it may be.
    #[error("{key}: found {found}, expected {expected}")]
    Value {
        /// The array.
        key: &'static str,
        /// The value and where it is.
        found: String,
        /// What it may be.
        expected: String,
    },
    /// The leaves hold spherical or anisotropic Gaussians.
    #[error(
        "data_format: found {format}, expected RGBA, SH1, SH4, SH9, SH16 or SH25: spherical and anisotropic Gaussians \
         are not supported"
    )]
    Gaussians {
        /// The `data_format` of the file.
        format: String,
    },
    /// `child` does not make a tree. Nodes are counted as in the file.
    #[error("child: {0}")]
    Tree(#[source] InvalidField),
    /// The arrays are sound each by itself and make no field together.
    #[error("{0}")]
    Field(#[source] InvalidField),
}

/// The start of a text from a file, fit for one line of a message.
pub(super) fn printable(text: &str) -> String {
    text.chars().take(60).flat_map(char::escape_debug).collect()
}

/// A shape, for messages; only the first of many axes.
fn shape(axes: &[u64]) -> String {
    const SHOWN: usize = 8;
    match axes.get(..SHOWN) {
        Some(first) if axes.len() > SHOWN => format!("{first:?} and {} axes more", axes.len() - SHOWN),
        _ => format!("{axes:?}"),
    }
}

#[cfg(test)]
mod tests {
    use super::shape;

    #[test]
    fn shapes_of_many_axes_are_cut_short() {
        assert_eq!(shape(&[]), "[]");
        assert_eq!(shape(&[2; 8]), "[2, 2, 2, 2, 2, 2, 2, 2]");
        assert_eq!(shape(&[1; 46]), "[1, 1, 1, 1, 1, 1, 1, 1] and 38 axes more");
    }
}
