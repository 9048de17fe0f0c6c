//! Cameras all around a capture.

use glam::DVec3;
use plenoctree::{
    UpAxis,
    camera::{PinholeCamera, Spiral},
};

/// Number of cameras.
const COUNT: u32 = 136;
/// Of this many cameras, one is held out.
const HELD_OUT: usize = 17;
/// Field of view, in radians.
const FOV: f64 = 0.6;
/// Their distances, as multiples of the one at which the whole box is in view.
const DISTANCES: [f64; 3] = [1.0, 0.85, 0.7];

/// Number of cameras at one distance to measure with, and of those to refine with: at one of several distances, and at
/// the only one.
const AT: [u32; 3] = [6, 80, 160];
/// The distances of those at the only one, as multiples of it.
const NEAR_IT: [f64; 3] = [1.0, 0.85, 1.2];
/// Number of cameras with small pictures at a distance, and from farther away.
const LOOKING: [u32; 2] = [100, 60];
/// Width and height of their pictures.
const SMALL: u32 = 64;

/// Cameras to refine with, and others to measure with.
pub struct Cameras {
    pub training: Vec<PinholeCamera>,
    pub held_out: Vec<PinholeCamera>,
}

/// Returns cameras that look at the middle of a box from everywhere, in the order of a spiral, with square images of
/// `size` pixels a side.
pub fn around(low: DVec3, high: DVec3, size: u32) -> Cameras {
    let spiral = Spiral {
        center: 0.5 * (low + high),
        radius: 0.5 * (high - low).length(),
        up: UpAxis::Z,
        fov: FOV,
        elevations: [1.0, -1.0],
        distances: &DISTANCES,
    };
    let (mut training, mut held_out) = (Vec::new(), Vec::new());
    for (index, camera) in spiral.cameras(COUNT, size).enumerate() {
        if index % HELD_OUT == HELD_OUT / 2 { &mut held_out } else { &mut training }.push(camera);
    }
    Cameras { training, held_out }
}

/// The same, at this distance. If it is the `only` one to refine for, cameras to refine with are at others near it, too.
pub fn at(low: DVec3, high: DVec3, distance: f64, size: u32, only: bool) -> Cameras {
    let [held_out, shared, alone] = AT;
    let (training, distances): (u32, &'static [f64]) = if only { (alone, &NEAR_IT) } else { (shared, &[]) };
    let cameras =
        |count: u32, distances: &'static [f64]| spiral(low, high, distance, distances).cameras(count, size).collect();
    Cameras { training: cameras(training, distances), held_out: cameras(held_out, &[]) }
}

/// Returns cameras with small pictures, which show where a field for a distance is looked at from: there, and from
/// farther away, at another distance.
pub fn looking(low: DVec3, high: DVec3, distance: f64, farther: f64) -> Vec<PinholeCamera> {
    let [there, beyond] = LOOKING;
    let there = spiral(low, high, distance, &NEAR_IT).cameras(there, SMALL);
    there.chain(spiral(low, high, farther, &[]).cameras(beyond, SMALL)).collect()
}

/// Returns cameras all around, at multiples of this distance from the middle.
fn spiral(low: DVec3, high: DVec3, distance: f64, distances: &'static [f64]) -> Spiral {
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
    let mean = DISTANCES.iter().sum::<f64>() / DISTANCES.len() as f64;
    mean * 0.5 * (high - low).length() / (0.5 * FOV).sin()
}

/// Returns the width of a pixel of these cameras at a distance.
pub fn pixel(distance: f64, size: u32) -> f64 {
    2.0 * (0.5 * FOV).tan() * distance / f64::from(size)
}
