//! Directions spread evenly over the sphere.

use std::f64::consts::PI;

use glam::DVec3;

/// Returns `count` unit vectors along a Fibonacci spiral around z, a golden angle apart, which cover the sphere evenly
/// between two heights: all of it from 1 to -1.
///
/// The first one is closest to the height `first`, the last one to `last`.
pub fn spiral(count: u32, [first, last]: [f64; 2]) -> impl Iterator<Item = DVec3> {
    let golden = PI * (3.0 - 5.0f64.sqrt());
    (0..count).map(move |index| {
        let height = first + (last - first) * (f64::from(index) + 0.5) / f64::from(count);
        let (level, turn) = ((1.0 - height * height).sqrt(), golden * f64::from(index));
        DVec3::new(level * turn.cos(), level * turn.sin(), height)
    })
}
