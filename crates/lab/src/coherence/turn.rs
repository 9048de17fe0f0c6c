//! The camera's path.

use std::f64::consts::FRAC_PI_2;

use plenoctree::{PlenOctree, camera::PinholeCamera};
use plenoctree_cli::turntable::{ELEVATION, START, around};

/// Returns at least two views along a turn of 90 degrees, both ends included, each of which shows the whole field, or
/// `None` if it is empty.
pub fn quarter(field: &PlenOctree, size: (u32, u32), frames: usize) -> Option<Vec<PinholeCamera>> {
    let azimuths = (0..frames).map(|frame| START + FRAC_PI_2 * frame as f64 / (frames - 1) as f64);
    around(field, size, azimuths, ELEVATION)
}
