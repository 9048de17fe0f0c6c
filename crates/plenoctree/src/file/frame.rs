//! Checks frames.

use glam::DVec3;

use super::error::ReadFault;
use crate::field::Frame;

/// The array of an `.npz` file that holds the offset and the scale of a frame that float32 would move, which only we read
/// and write.
pub(super) const EXACT_FRAME: &str = "frame_float64";

/// Returns a frame as float32 holds it.
pub(super) fn in_float32(frame: Frame) -> Frame {
    Frame { offset: frame.offset.as_vec3().as_dvec3(), scale: frame.scale.as_vec3().as_dvec3() }
}

/// Returns an error unless a frame is valid, also in float32: files store frames in it, and props are placed in it.
/// `keys` are what offset and scale are called in errors.
pub(crate) fn check_frame([offset_key, scale_key]: [&'static str; 2], frame: Frame) -> Result<(), ReadFault> {
    let Frame { offset, scale } = frame;
    let fault = |key, numbers: DVec3, expected: &str| {
        Err(ReadFault::Value { key, found: format!("{:?}", numbers.to_array()), expected: expected.into() })
    };
    if !scale.is_finite() || scale.min_element() <= 0.0 {
        return fault(scale_key, scale, "finite positive numbers");
    }
    if !offset.is_finite() {
        return fault(offset_key, offset, "finite numbers");
    }
    if !offset.as_vec3().is_finite() {
        return fault(offset_key, offset, "numbers within the range of float32");
    }
    let corners = [DVec3::ZERO, DVec3::ONE].map(|corner| frame.to_world(corner).as_vec3());
    if !scale.as_vec3().is_finite() || !corners.iter().all(|corner| corner.is_finite()) {
        return fault(scale_key, scale, "a scale and a cube within the range of float32");
    }
    Ok(())
}
