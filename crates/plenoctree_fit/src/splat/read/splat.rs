//! `.splat` files: 32 bytes for each Gaussian, and nothing else.

use glam::{Quat, Vec3};

use super::shared::constant;
use crate::{
    file::{Fault, Number},
    splat::splats::{Gaussian, Splats},
};

/// Size of a Gaussian.
const SIZE: usize = 32;

pub fn read(bytes: &[u8]) -> Result<Splats, Fault> {
    if !bytes.len().is_multiple_of(SIZE) {
        let found = format!("a .splat file of {} bytes", bytes.len());
        return Err(Fault::found("format", found, "a multiple of 32 bytes"));
    }
    let mut splats = Splats::new(0);
    splats.reserve(bytes.len() / SIZE);
    for row in bytes.chunks_exact(SIZE) {
        let float = |index: usize| Number::F32.read(&row[4 * index..], false) as f32;
        let byte = |index: usize| f32::from(row[24 + index]);
        let [w, x, y, z] = [4, 5, 6, 7].map(|index| (byte(index) - 128.0) / 128.0);
        let gaussian = Gaussian {
            position: Vec3::new(float(0), float(1), float(2)),
            scale: Vec3::new(float(3), float(4), float(5)),
            rotation: Quat::from_xyzw(x, y, z, w),
            opacity: byte(3) / 255.0,
        };
        splats.push(gaussian, &[constant(Vec3::new(byte(0), byte(1), byte(2)) / 255.0)]);
    }
    Ok(splats)
}
