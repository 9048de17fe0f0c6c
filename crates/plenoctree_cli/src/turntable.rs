//! Cameras around a field.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec3};
use plenoctree::{PlenOctree, camera::PinholeCamera};

/// The elevation above the horizon, in radians.
pub const ELEVATION: f64 = 20.0 * PI / 180.0;
/// The azimuth at which turns start, in radians from the field's front.
pub const START: f64 = 25.0 * PI / 180.0;

/// Returns views from all around and slightly above, each of which shows the whole field, or `None` if it is empty.
pub fn full_turn(field: &PlenOctree, size: (u32, u32), frames: usize) -> Option<Vec<PinholeCamera>> {
    let azimuths = (0..frames).map(|frame| START + TAU * frame as f64 / frames as f64);
    around(field, size, azimuths, ELEVATION)
}

/// Returns views from these azimuths and one elevation, in radians, each of which shows the whole field, or `None` if
/// it is empty.
pub fn around(
    field: &PlenOctree,
    (width, height): (u32, u32),
    azimuths: impl Iterator<Item = f64>,
    elevation: f64,
) -> Option<Vec<PinholeCamera>> {
    azimuths.map(|azimuth| PinholeCamera::around(field, width, height, azimuth, elevation)).collect()
}

/// Returns the camera, turned around the field's up axis by an angle in radians.
pub fn turned(field: &PlenOctree, camera: &PinholeCamera, angle: f64) -> PinholeCamera {
    let up = field.up().to_y_up().transpose() * DVec3::Y;
    let turn = DMat3::from_axis_angle(up, angle);
    PinholeCamera { rotation: turn * camera.rotation, position: turn * camera.position, ..*camera }
}
