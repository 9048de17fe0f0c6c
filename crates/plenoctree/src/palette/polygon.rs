//! Convex hulls of clouds of colors in a plane, and their simplification.

use glam::DVec2;
use robust::{Coord, orient2d};

use super::hull::ROUNDING;

/// Returns the corners of the convex hull, counterclockwise.
pub(super) fn corners(points: &[DVec2]) -> Vec<DVec2> {
    // Adding 0 makes -0 the same as 0, also to `total_cmp`.
    let mut sorted: Vec<DVec2> = points.iter().map(|point| point + DVec2::ZERO).collect();
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let mut chain = half(sorted.iter());
    chain.extend(half(sorted.iter().rev()));
    // Remove points that are only corners because of rounding: those on an edge between two others.
    while chain.len() > 2 {
        let count = chain.len();
        let height = |i: usize| height(chain[(i + count - 1) % count], chain[i], chain[(i + 1) % count]);
        let Some(flattest) = (0..count).min_by(|&a, &b| height(a).total_cmp(&height(b))) else { break };
        if height(flattest) > ROUNDING {
            break;
        }
        chain.remove(flattest);
    }
    chain
}

/// Returns the lower or the upper half of the hull of sorted points, without its last point.
fn half<'a>(sorted: impl Iterator<Item = &'a DVec2>) -> Vec<DVec2> {
    let coord = |p: DVec2| Coord { x: p.x, y: p.y };
    let mut chain: Vec<DVec2> = Vec::new();
    for &point in sorted {
        while let [.., a, b] = chain[..]
            && orient2d(coord(a), coord(b), coord(point)) <= 0.0
        {
            chain.pop();
        }
        chain.push(point);
    }
    chain.pop();
    chain
}

/// Returns the distance of `point` from the line through its neighbors.
fn height(previous: DVec2, point: DVec2, next: DVec2) -> f64 {
    let along = (next - previous).normalize_or_zero();
    along.perp_dot(previous - point).abs()
}

/// Collapses the edge of a convex polygon (counterclockwise) that adds the least area, unless it is a triangle or no
/// edge can be collapsed.
///
/// An edge collapses to the point where its neighboring edges meet: the solution of the linear program of the solid
/// case, in a plane.
pub(super) fn collapse_an_edge(polygon: &[DVec2]) -> Option<Vec<DVec2>> {
    let count = polygon.len();
    let collapses = (0..count).filter_map(|i| {
        let at = |step: usize| polygon[(i + step) % count];
        let (a, b) = (at(1), at(2));
        let corner = meeting(at(0), a, b, at(3))?;
        Some((i, corner, (b - a).perp_dot(corner - a).abs()))
    });
    let (i, corner, _) = collapses.min_by(|a, b| a.2.total_cmp(&b.2)).filter(|_| count > 3)?;
    let mut polygon = polygon.to_vec();
    polygon[(i + 1) % count] = corner;
    polygon.remove((i + 2) % count);
    Some(corners(&polygon))
}

/// Returns the point where the edges p-a and q-b of a convex polygon meet beyond the edge a-b between them, if they do.
fn meeting(p: DVec2, a: DVec2, b: DVec2, q: DVec2) -> Option<DVec2> {
    let (u, v) = (a - p, q - b);
    let cross = u.perp_dot(v);
    let t = (b - a).perp_dot(v) / cross;
    (cross > ROUNDING * u.length() * v.length()).then(|| a + t * u).filter(|corner| corner.is_finite())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Returns the distance of `point` outside a counterclockwise polygon.
    fn outside(polygon: &[DVec2], point: DVec2) -> f64 {
        (0..polygon.len())
            .map(|i| {
                let (a, b) = (polygon[i], polygon[(i + 1) % polygon.len()]);
                -(b - a).normalize().perp_dot(point - a)
            })
            .fold(f64::NEG_INFINITY, f64::max)
    }

    /// Collapses edges until there are this many corners, or none can be collapsed.
    fn simplify(mut polygon: Vec<DVec2>, max_corners: usize) -> Vec<DVec2> {
        while polygon.len() > max_corners
            && let Some(next) = collapse_an_edge(&polygon)
        {
            polygon = next;
        }
        polygon
    }

    #[test]
    fn only_corners_are_corners() {
        let grid: Vec<DVec2> = (0..35).map(|i| DVec2::new(f64::from(i % 7) * 0.1, f64::from(i / 7) * 0.3)).collect();
        assert_eq!(corners(&grid).len(), 4);
    }

    #[test]
    fn zeros_of_either_sign_are_the_same() {
        let points = [(0.0, 0.0), (-0.0, 0.5), (0.0, 1.0), (1.0, 0.0)].map(|(x, y)| DVec2::new(x, y));
        assert_eq!(corners(&points), [points[0], points[3], points[2]]);
    }

    /// Collapsing edges restores a square whose corners were cut off, and then leaves it unchanged.
    #[test]
    fn cut_corners_grow_back() {
        let octagon = [(0.1, 0.0), (0.9, 0.0), (1.0, 0.1), (1.0, 0.9), (0.9, 1.0), (0.1, 1.0), (0.0, 0.9), (0.0, 0.1)];
        let octagon: Vec<DVec2> = octagon.into_iter().map(|(x, y)| DVec2::new(x, y)).collect();
        let mut square = simplify(corners(&octagon), 3);
        square.iter_mut().for_each(|p| *p = (*p * 1e9).round() / 1e9);
        assert_eq!(corners(&square), [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y]);
    }

    proptest! {
        /// Simplification reaches the given number of corners, since a polygon of five or more can always lose one, and
        /// never cuts off a point.
        #[test]
        fn simplification_contains_all_points(
            points in prop::collection::vec((0.0..1.0f64, 0.0..1.0f64), 3..40),
            max_corners in 4usize..8,
        ) {
            let points: Vec<DVec2> = points.into_iter().map(|(x, y)| DVec2::new(x, y)).collect();
            let polygon = simplify(corners(&points), max_corners);
            prop_assert!(polygon.len() <= max_corners);
            for &point in &points {
                prop_assert!(outside(&polygon, point) < 1e-9, "{polygon:?} {point}");
            }
        }
    }
}
