//! Shared by the readers of all formats.

use crate::splat::error::Fault;

/// Number of Gaussians above which the count is checked against the size of the file.
const MANY: u64 = 1 << 20;
/// Minimum size of a file per Gaussian, in bytes, if there are that many.
const FEWEST_BYTES: u64 = 4;

/// Reads a file next to the capture.
pub type Beside<'a> = &'a mut dyn FnMut(&str) -> Result<Vec<u8>, Fault>;

/// Checks a number of Gaussians against the size of the file, before memory is allocated for them.
pub fn check_count(what: &str, count: u64, bytes: u64) -> Result<usize, Fault> {
    let most = MANY.max(bytes / FEWEST_BYTES);
    if count > most {
        let expected = format!("at most {most} in a file of {bytes} bytes");
        return Err(Fault::found(what, format!("{count} Gaussians"), expected));
    }
    Ok(count as usize)
}

/// The logistic function: converts log odds to a probability.
pub fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + (-x).exp())
}
