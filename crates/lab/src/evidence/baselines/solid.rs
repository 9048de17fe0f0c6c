//! Distances from the convex hull of a few colors.

use glam::DVec3;

/// Lengths and volumes below this are due to rounding.
const ROUNDING: f64 = 1e-12;

/// The convex hull of a few points, which may be flat.
pub struct Solid {
    /// Planes with all points on or below them, as a unit normal and an offset. Empty if the points have no volume.
    planes: Vec<(DVec3, f64)>,
    /// Triangles whose union is the surface. With two equal corners, a triangle is a line.
    triangles: Vec<[DVec3; 3]>,
}

impl Solid {
    /// Creates the hull of at least one point. It visits all triples of points, so they should be few.
    pub fn new(points: &[DVec3]) -> Self {
        let mut planes = Vec::new();
        let mut triangles = Vec::new();
        let mut has_volume = false;
        for (i, &a) in points.iter().enumerate() {
            for (j, &b) in points.iter().enumerate().skip(i + 1) {
                for &c in &points[j + 1..] {
                    let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
                    let heights = points.iter().map(|point| normal.dot(*point - a));
                    let (low, high) = heights.fold((0.0f64, 0.0f64), |(low, high), h| (low.min(h), high.max(h)));
                    has_volume |= high - low > 1e-9;
                    if low > -1e-9 {
                        planes.push((-normal, -normal.dot(a)));
                    }
                    if high < 1e-9 {
                        planes.push((normal, normal.dot(a)));
                    }
                    if low > -1e-9 || high < 1e-9 {
                        triangles.push([a, b, c]);
                    }
                }
            }
        }
        if !has_volume {
            planes.clear();
        }
        if triangles.is_empty() {
            let pairs = points.iter().flat_map(|&a| points.iter().map(move |&b| [a, b, b]));
            triangles.extend(pairs);
        }
        Self { planes, triangles }
    }

    /// Returns the distance of a point, 0 if it is inside.
    pub fn distance(&self, point: DVec3) -> f64 {
        let inside = |(normal, offset): &(DVec3, f64)| normal.dot(point) <= *offset;
        if !self.planes.is_empty() && self.planes.iter().all(inside) {
            return 0.0;
        }
        let squared = self.triangles.iter().map(|&triangle| from_triangle(point, triangle));
        squared.fold(f64::INFINITY, f64::min).sqrt()
    }
}

/// Returns the squared distance of a point from a triangle.
fn from_triangle(point: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let normal = (b - a).cross(c - a);
    let squared = normal.length_squared();
    if squared > ROUNDING * ROUNDING {
        let beside = |from: DVec3, to: DVec3| (to - from).cross(point - from).dot(normal) < 0.0;
        if !beside(a, b) && !beside(b, c) && !beside(c, a) {
            return normal.dot(point - a).powi(2) / squared;
        }
    }
    [(a, b), (b, c), (c, a)].map(|(from, to)| from_segment(point, from, to)).into_iter().fold(f64::INFINITY, f64::min)
}

fn from_segment(point: DVec3, from: DVec3, to: DVec3) -> f64 {
    let along = to - from;
    let share = ((point - from).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    point.distance_squared(from + share * along)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_from_a_box_a_square_a_line_and_a_point() {
        let cube: Vec<_> =
            (0..8).map(|i| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2))).collect();
        let near = |solid: &[DVec3], point: [f64; 3], expected: f64| {
            let found = Solid::new(solid).distance(point.into());
            assert!((found - expected).abs() < 1e-12, "{found}, expected {expected}");
        };
        near(&cube, [0.5, 0.9, 0.1], 0.0);
        near(&cube, [0.5, 1.5, 0.1], 0.5);
        near(&cube, [2.0, 2.0, 0.5], 2f64.sqrt());
        near(&cube[..4], [0.25, 0.5, -0.5], 0.5);
        near(&cube[..4], [2.0, 0.5, 0.0], 1.0);
        near(&cube[..2], [0.5, 3.0, 4.0], 5.0);
        near(&cube[..1], [3.0, 4.0, 0.0], 5.0);
    }
}
