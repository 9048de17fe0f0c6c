//! Shared by the readers of all formats.

use glam::{Quat, Vec3};
use plenoctree::Basis;

use crate::file::Fault;

/// Number of Gaussians above which the count is checked against the size of the file.
const MANY: u64 = 1 << 20;
/// Minimum size of a file per Gaussian, in bytes, if there are that many.
const FEWEST_BYTES: u64 = 4;

/// Largest size of a file next to a capture, such as an image, and of all buffers of a glTF file: 2 GiB.
pub const LARGEST_FILE: u64 = 2 << 30;

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

/// Returns the quaternion without one part, which is the largest: the first of w, x, y and z if `largest` is 0. The
/// others are 0 to 1, for the range that they can have.
pub fn without_largest(parts: [f32; 3], largest: u8) -> Quat {
    let [a, b, c] = parts.map(|part| (2.0 * part - 1.0) * std::f32::consts::FRAC_1_SQRT_2);
    let rest = (1.0 - a * a - b * b - c * c).max(0.0).sqrt();
    let [w, x, y, z] = match largest {
        0 => [rest, a, b, c],
        1 => [a, rest, b, c],
        2 => [a, b, rest, c],
        _ => [a, b, c, rest],
    };
    Quat::from_xyzw(x, y, z, w)
}

/// Returns the coefficient of the constant harmonic that gives a color.
pub fn constant(color: Vec3) -> Vec3 {
    (color - 0.5) / Basis::FACTORS[0] as f32
}
