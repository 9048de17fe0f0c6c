//! Cameras all around a capture.

use glam::DVec3;
use plenoctree::{
    UpAxis,
    camera::{PinholeCamera, Spiral},
};

/// Number of cameras to measure with where the whole box is in view, and at other distances.
const WHOLE: u32 = 8;
const MEASURING: u32 = 6;
/// Number of cameras to refine with.
const REFINING: u32 = 160;
/// Number of cameras with small pictures nearby, and from halfway.
const LOOKING: [u32; 2] = [48, 32];
/// Width and height of their pictures.
const SMALL: u32 = 64;
/// Field of view, in radians.
const FOV: f64 = 0.6;
/// The distances where the whole box is in view, as multiples of the one at which it just fits.
const FAR: [f64; 3] = [1.0, 0.85, 0.7];
/// The distances to refine with, as multiples of the nearby one. From farther away, captures look different.
const NEARBY: [f64; 3] = [1.0, 0.85, 1.2];
/// The distances of small pictures nearby.
const AROUND: [f64; 4] = [1.0, 0.85, 1.2, 1.6];

/// Returns cameras with square images of `size` pixels a side, which see the whole box, to measure with. Like all of
/// these cameras, they look at its middle from everywhere, in the order of a spiral.
pub fn whole(low: DVec3, high: DVec3, size: u32) -> Vec<PinholeCamera> {
    around(low, high, fitting(low, high), &FAR).cameras(WHOLE, size).collect()
}

/// Returns cameras at a distance to measure with.
pub fn measuring(low: DVec3, high: DVec3, distance: f64, size: u32) -> Vec<PinholeCamera> {
    around(low, high, distance, &[]).cameras(MEASURING, size).collect()
}

/// Returns cameras at about a distance, to refine with.
pub fn refining(low: DVec3, high: DVec3, near: f64, size: u32) -> Vec<PinholeCamera> {
    around(low, high, near, &NEARBY).cameras(REFINING, size).collect()
}

/// Returns cameras with small pictures, which show from where a field is looked at: nearby, and from halfway.
pub fn looking(low: DVec3, high: DVec3, near: f64, between: f64) -> Vec<PinholeCamera> {
    let [nearby, halfway] = LOOKING;
    let nearby = around(low, high, near, &AROUND).cameras(nearby, SMALL);
    nearby.chain(around(low, high, between, &[]).cameras(halfway, SMALL)).collect()
}

/// Returns cameras all around, at multiples of this distance from the middle.
fn around(low: DVec3, high: DVec3, distance: f64, distances: &'static [f64]) -> Spiral {
    Spiral {
        center: 0.5 * (low + high),
        radius: distance * (0.5 * FOV).sin(),
        up: UpAxis::Z,
        fov: FOV,
        elevations: [1.0, -1.0],
        distances,
    }
}

/// Returns the mean distance of the cameras that see the whole box, from its middle.
pub fn far(low: DVec3, high: DVec3) -> f64 {
    FAR.iter().sum::<f64>() / FAR.len() as f64 * fitting(low, high)
}

/// Returns the distance at which the box just fits into the image.
fn fitting(low: DVec3, high: DVec3) -> f64 {
    0.5 * (high - low).length() / (0.5 * FOV).sin()
}

/// Returns the width of a pixel of these cameras at a distance.
pub fn pixel(distance: f64, size: u32) -> f64 {
    2.0 * (0.5 * FOV).tan() * distance / f64::from(size)
}
