//! How much memory files may ask for.

/// What every file may ask for, in bytes, and by which factor larger ones may ask for more than their own size. Trained
/// fields stay below a factor of 20.
const LEAST: u64 = 1 << 30;
const RATIO: u64 = 200;

/// Returns how many bytes a file of `file` bytes may hold. If it claims more, it is likely made to exhaust memory.
pub(super) fn room(file: u64) -> u64 {
    file.saturating_mul(RATIO).max(LEAST)
}

/// An error that occurs when writing a field: a large field of which so much is the same that its file would be too
/// small for readers to believe it.
#[cfg(feature = "write")]
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("found {content} bytes in a file of {file}, expected at most {}: make the field less deep", room(*file))]
pub struct TooEven {
    /// Size of the content, in bytes.
    pub content: u64,
    /// Size of the file, in bytes.
    pub file: u64,
}

#[cfg(feature = "write")]
impl TooEven {
    /// Returns an error if readers would reject a file with this content.
    pub(crate) fn check(content: u64, file: u64) -> Result<(), Self> {
        if content <= room(file) { Ok(()) } else { Err(Self { content, file }) }
    }
}

#[cfg(all(test, feature = "write"))]
mod tests {
    use super::*;

    #[test]
    fn small_files_hold_a_gigabyte_and_large_ones_more() {
        for (file, most) in [(0, 1 << 30), (5_000_000, 1 << 30), (10_000_000, 2_000_000_000), (u64::MAX, u64::MAX)] {
            assert_eq!(TooEven::check(most, file), Ok(()));
            let more = most.saturating_add(1);
            assert_eq!(TooEven::check(more, file).is_err(), more > most);
        }
    }
}
