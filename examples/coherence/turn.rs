//! The camera's way.

use bevy_plenoctree::{PlenOctree, camera::PinholeCamera};

/// Height over the horizon and where the turn begins, in radians.
const ELEVATION: f64 = 20.0 * std::f64::consts::PI / 180.0;
const START: f64 = 25.0 * std::f64::consts::PI / 180.0;

/// Views along a turn by 90 degrees around the field, each of which shows all of it; `None` if the field is empty. There
/// must be at least two.
pub fn quarter(field: &PlenOctree, (width, height): (u32, u32), frames: usize) -> Option<Vec<PinholeCamera>> {
    let azimuth = |frame| START + std::f64::consts::FRAC_PI_2 * frame as f64 / (frames - 1) as f64;
    (0..frames).map(|frame| PinholeCamera::around(field, width, height, azimuth(frame), ELEVATION)).collect()
}
