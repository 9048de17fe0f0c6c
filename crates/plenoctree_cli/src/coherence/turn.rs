//! The camera's path.

use std::f64::consts::FRAC_PI_2;

use plenoctree::{PlenOctree, camera::PinholeCamera};

use crate::turntable::{ELEVATION, START, around};

/// Views along a turn of 90 degrees, both ends included, each of which shows the whole field; `None` if the field is
/// empty. There must be at least two.
pub fn quarter(field: &PlenOctree, size: (u32, u32), frames: usize) -> Option<Vec<PinholeCamera>> {
    let azimuths = (0..frames).map(|frame| START + FRAC_PI_2 * frame as f64 / (frames - 1) as f64);
    around(field, size, azimuths, ELEVATION)
}
