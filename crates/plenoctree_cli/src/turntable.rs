//! Cameras around a field.

use std::f64::consts::{PI, TAU};

use plenoctree::{PlenOctree, camera::PinholeCamera};

/// Height above the horizon, in radians.
pub const ELEVATION: f64 = 20.0 * PI / 180.0;
/// Where turns begin, in radians from the field's front.
pub const START: f64 = 25.0 * PI / 180.0;

/// Views from all around and a little above, each of which shows the whole field; `None` if the field is empty.
pub fn full_turn(field: &PlenOctree, size: (u32, u32), frames: usize) -> Option<Vec<PinholeCamera>> {
    let azimuths = (0..frames).map(|frame| START + TAU * frame as f64 / frames as f64);
    around(field, size, azimuths, ELEVATION)
}

/// Views from these azimuths and one elevation, in radians, each of which shows the whole field; `None` if the field is
/// empty.
pub fn around(
    field: &PlenOctree,
    (width, height): (u32, u32),
    azimuths: impl Iterator<Item = f64>,
    elevation: f64,
) -> Option<Vec<PinholeCamera>> {
    azimuths.map(|azimuth| PinholeCamera::around(field, width, height, azimuth, elevation)).collect()
}
