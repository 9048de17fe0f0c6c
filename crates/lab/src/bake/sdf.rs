//! Signed distance functions: primitives around the origin, and operators that combine them. Negative is inside.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

/// The nearest part of a prop and the distance to it.
#[derive(Clone, Copy, Debug)]
pub struct Nearest<P> {
    /// The signed distance, in world units.
    pub distance: f64,
    /// The nearest part.
    pub part: P,
}

impl<P> Nearest<P> {
    /// Starts with one part.
    pub fn new(distance: f64, part: P) -> Self {
        Self { distance, part }
    }

    /// Adds a part.
    pub fn add(&mut self, distance: f64, part: P) {
        if distance < self.distance {
            *self = Self { distance, part };
        }
    }

    /// Adds a group of parts that are all inside the ball at `center` with `radius`. The group is skipped if the ball
    /// is farther away than the nearest part so far.
    pub fn add_group(&mut self, position: DVec3, center: DVec3, radius: f64, add: impl FnOnce(&mut Self)) {
        if position.distance(center) - radius < self.distance.max(0.0) {
            add(self);
        }
    }
}

/// A ball.
pub fn sphere(p: DVec3, radius: f64) -> f64 {
    p.length() - radius
}

/// An ellipsoid; exact on its surface, close nearby.
pub fn ellipsoid(p: DVec3, radii: DVec3) -> f64 {
    let outer = (p / radii).length();
    let gradient = (p / (radii * radii)).length();
    if gradient < 1e-9 { -radii.min_element() } else { outer * (outer - 1.0) / gradient }
}

/// A box with rounded edges; `half` is half its size, rounding included.
pub fn cuboid(p: DVec3, half: DVec3, round: f64) -> f64 {
    let q = p.abs() - half + round;
    q.max(DVec3::ZERO).length() + q.max_element().min(0.0) - round
}

/// A cylinder along z with rounded edges.
pub fn cylinder(p: DVec3, radius: f64, half_height: f64, round: f64) -> f64 {
    rectangle(DVec2::new(p.truncate().length(), p.z), DVec2::new(radius, half_height), round)
}

/// A rectangle in the plane with rounded corners.
pub fn rectangle(p: DVec2, half: DVec2, round: f64) -> f64 {
    let q = p.abs() - half + round;
    q.max(DVec2::ZERO).length() + q.max_element().min(0.0) - round
}

/// A ring around z; `tube` is the radius of its tube.
pub fn torus(p: DVec3, radius: f64, tube: f64) -> f64 {
    DVec2::new(p.truncate().length() - radius, p.z).length() - tube
}

/// A rod from `a` to `b` with round ends, whose radius changes linearly.
pub fn rod(p: DVec3, a: DVec3, b: DVec3, radius_a: f64, radius_b: f64) -> f64 {
    let along = b - a;
    let t = ((p - a).dot(along) / along.length_squared()).clamp(0.0, 1.0);
    p.distance(a + t * along) - (radius_a + t * (radius_b - radius_a))
}

/// The outline of a door or window in the plane: straight sides from 0 up to `height`, and a half circle on top.
pub fn arch(p: DVec2, half_width: f64, height: f64) -> f64 {
    if p.y > height { (p - DVec2::new(0.0, height)).length() - half_width } else { (p.x.abs() - half_width).max(-p.y) }
}

/// An extruded outline: `outline` is the distance in its plane, `depth` the distance from that plane.
pub fn extrude(outline: f64, depth: f64, half: f64, round: f64) -> f64 {
    let q = DVec2::new(outline + round, depth.abs() - half + round);
    q.max(DVec2::ZERO).length() + q.max_element().min(0.0) - round
}

/// A union with a fillet about `width` wide.
pub fn blend(a: f64, b: f64, width: f64) -> f64 {
    let h = (width - (a - b).abs()).max(0.0) / width;
    a.min(b) - 0.25 * h * h * width
}

/// An intersection with a rounded edge about `width` wide.
pub fn blend_cut(a: f64, b: f64, width: f64) -> f64 {
    -blend(-a, -b, width)
}

/// Folds space around z, so that one of `count` equal sectors, the one around +x, represents all. Returns the folded
/// point and the sector's index.
pub fn fold(p: DVec3, count: usize) -> (DVec3, usize) {
    let sector = TAU / count as f64;
    let index = (p.y.atan2(p.x) / sector).round();
    (p.rotate_z(-index * sector), (index.rem_euclid(count as f64)) as usize % count)
}

/// Returns 0 below `low`, 1 above `high`, and smooth values in between. `low` can be greater than `high`.
pub fn smoothstep(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
