//! Cameras all around a capture.

use glam::{DMat4, DVec3};
use plenoctree::camera::PinholeCamera;

/// Number of cameras.
const COUNT: usize = 136;
/// Of this many cameras, one is held out.
const HELD_OUT: usize = 17;
/// Field of view, in radians.
const FOV: f64 = 0.6;
/// Their distances, as multiples of the one at which the whole box is in view.
const DISTANCES: [f64; 3] = [1.0, 0.85, 0.7];

/// Cameras to refine with, and others to measure with.
pub struct Cameras {
    pub training: Vec<PinholeCamera>,
    pub held_out: Vec<PinholeCamera>,
}

/// Returns cameras that look at the middle of a box from everywhere, in the order of a spiral, with square images of
/// `size` pixels a side.
pub fn around(low: DVec3, high: DVec3, size: u32) -> Cameras {
    let (center, radius) = (0.5 * (low + high), 0.5 * (high - low).length());
    let golden = std::f64::consts::PI * (3.0 - 5.0f64.sqrt());
    let camera = |index: usize| {
        let height = 1.0 - 2.0 * (index as f64 + 0.5) / COUNT as f64;
        let (level, turn) = ((1.0 - height * height).sqrt(), golden * index as f64);
        let outward = DVec3::new(level * turn.cos(), level * turn.sin(), height);
        let distance = DISTANCES[index % DISTANCES.len()] * radius / (0.5 * FOV).sin();
        let camera = PinholeCamera::new(size, size, FOV, DMat4::IDENTITY);
        camera.looking_at(center + distance * outward, center, DVec3::Z)
    };
    let (held_out, training) = (0..COUNT).partition::<Vec<_>, _>(|index| index % HELD_OUT == HELD_OUT / 2);
    let all = |indices: Vec<usize>| indices.into_iter().map(camera).collect();
    Cameras { training: all(training), held_out: all(held_out) }
}
