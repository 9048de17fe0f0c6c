//! Simplification of convex hulls: section 3 of the method, step 8.
//!
//! The linear programs have three unknowns and about a dozen constraints. They are solved by visiting every line where
//! two constraints meet. This is exact, whereas the tolerance of a general solver would cut off colors.

use std::iter::successors;

use glam::{DVec2, DVec3};

use super::{
    hull::{Hull, Plane, ROUNDING, Span, edges, span},
    polygon,
};
use crate::sampling::Progress;

/// Shapes that contain all points, from their convex hull to the simplest one.
#[derive(Clone, Debug)]
pub(super) struct Simplified {
    /// The corners of each shape. There is at least one shape.
    shapes: Vec<Vec<DVec3>>,
}

impl Simplified {
    /// Returns the corners of the first shape with at most this many or, if there is none, of the simplest one.
    pub fn corners(&self, most: usize) -> &[DVec3] {
        let found = self.shapes.iter().find(|corners| corners.len() <= most);
        found.or(self.shapes.last()).map_or(&[], Vec::as_slice)
    }

    /// Returns the number of corners before simplification.
    pub fn before(&self) -> usize {
        self.shapes.first().map_or(0, Vec::len)
    }
}

/// Simplifies the convex hull of `points` to at most `max_corners` corners, unless no more edges can be collapsed. There
/// must be at least one point, and all must be finite.
///
/// Once `progress` is canceled, returns a shape that is not simple enough, or not complete.
///
/// The result may leave the RGB cube. Points without volume have no hull. They span a point, a line or a polygon
/// instead, and a polygon is simplified in the same way.
pub(super) fn simplify(points: &[DVec3], max_corners: usize, progress: &Progress) -> Simplified {
    let shapes = match span(points, progress) {
        Span::Corners(corners) => vec![corners],
        Span::Plane([origin, along, across], flat) => {
            let place = |p: &DVec2| origin + p.x * along + p.y * across;
            let polygons = successors(Some(polygon::corners(&flat)), |corners| {
                (corners.len() > max_corners).then(|| polygon::collapse_an_edge(corners))?
            });
            polygons.map(|corners| corners.iter().map(place).collect()).collect()
        }
        Span::Solid(hull) => {
            let hulls = successors(Some(hull), |hull| {
                (hull.vertices.len() > max_corners).then(|| collapse_an_edge(hull, progress))?
            });
            hulls.map(|hull| hull.vertices).collect()
        }
    };
    Simplified { shapes }
}

/// Replaces the edge whose collapse adds the least volume by a corner. Returns `None` if no edge can be collapsed, or
/// once `progress` is canceled.
fn collapse_an_edge(hull: &Hull, progress: &Progress) -> Option<Hull> {
    let faces: Vec<(Plane, f64)> = hull
        .faces
        .iter()
        .map(|&face| {
            let [a, b, c] = hull.triangle(face);
            let area = 0.5 * (b - a).cross(c - a).length();
            let plane = Plane::through([a, b, c]).unwrap_or(Plane { normal: DVec3::ZERO, offset: 0.0 });
            (plane, area)
        })
        .collect();
    let mut best: Option<(f64, (usize, usize), DVec3)> = None;
    for (a, b) in hull.faces.iter().flat_map(|&face| edges(face)).filter(|(a, b)| a < b) {
        let touching: Vec<(Plane, f64)> = hull
            .faces
            .iter()
            .zip(&faces)
            .filter(|(face, _)| face.contains(&a) || face.contains(&b))
            .map(|(_, &face)| face)
            .collect();
        let planes: Vec<Plane> = touching.iter().map(|&(plane, _)| plane).collect();
        let corner = nearest_outside(&planes, progress);
        if progress.is_canceled() {
            return None;
        }
        let Some(corner) = corner else { continue };
        let volume: f64 = touching.iter().map(|(plane, area)| plane.distance(corner).abs() * area / 3.0).sum();
        if best.is_none_or(|(least, ..)| volume < least) {
            best = Some((volume, (a, b), corner));
        }
    }
    let (_, (a, b), corner) = best?;
    let kept = (0..hull.vertices.len()).filter(|&vertex| vertex != a && vertex != b);
    let points: Vec<DVec3> = kept.map(|vertex| hull.vertices[vertex]).chain([corner]).collect();
    match span(&points, progress) {
        // A hull that does not shrink would be collapsed forever, and a very distant corner is not exact enough to
        // contain every color.
        Span::Solid(next) if next.vertices.len() < hull.vertices.len() && next.contains(&hull.vertices) => Some(next),
        _ => None,
    }
}

/// Returns the point on the positive side of all planes with the smallest sum of distances to them, if there is one.
///
/// Such a point is a corner of the region that the planes bound. Where two planes meet in a line, the others cut the
/// line to an interval, whose ends are corners. Once `progress` is canceled, returns the best point so far.
fn nearest_outside(planes: &[Plane], progress: &Progress) -> Option<DVec3> {
    let mut best: Option<(f64, DVec3)> = None;
    for (i, first) in planes.iter().enumerate() {
        for (j, second) in planes.iter().enumerate().skip(i + 1) {
            if progress.is_canceled() {
                break;
            }
            let cross = first.normal.cross(second.normal);
            let squared = cross.length_squared();
            if squared < ROUNDING * ROUNDING {
                continue;
            }
            let along = cross / squared.sqrt();
            let origin = (first.offset * second.normal - second.offset * first.normal).cross(cross) / squared;
            let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
            for (k, plane) in planes.iter().enumerate() {
                let (slope, distance) = (plane.normal.dot(along), plane.distance(origin));
                if k == i || k == j || slope.abs() < ROUNDING {
                    continue;
                }
                if slope > 0.0 {
                    low = low.max(-distance / slope);
                } else {
                    high = high.min(-distance / slope);
                }
            }
            for point in [origin + low * along, origin + high * along] {
                let distances = planes.iter().map(|plane| plane.distance(point));
                let sum: f64 = distances.clone().sum();
                if best.is_none_or(|(least, _)| sum < least)
                    && point.is_finite()
                    && distances.fold(f64::INFINITY, f64::min) >= -ROUNDING
                {
                    best = Some((sum, point));
                }
            }
        }
    }
    best.map(|(_, point)| point)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn span(points: &[DVec3]) -> Span {
        super::span(points, &Progress::default())
    }

    fn simplify(points: &[DVec3], max_corners: usize) -> Simplified {
        super::simplify(points, max_corners, &Progress::default())
    }

    fn collapse_an_edge(hull: &Hull) -> Option<Hull> {
        super::collapse_an_edge(hull, &Progress::default())
    }

    fn lattice() -> impl Strategy<Value = Vec<DVec3>> {
        let point =
            prop::array::uniform3(0..6u8).prop_map(|p| DVec3::from_array(p.map(|x| (f64::from(x) + 0.5) / 8.0)));
        prop::collection::vec(point, 1..40)
    }

    fn cloud() -> impl Strategy<Value = Vec<DVec3>> {
        prop::collection::vec(prop::array::uniform3(0.0..1.0f64).prop_map(DVec3::from_array), 1..40)
    }

    proptest! {
        /// Collapsing an edge never cuts off a color, and always makes the hull simpler.
        #[test]
        fn every_step_contains_the_cloud(points in prop_oneof![lattice(), cloud()]) {
            if let Span::Solid(mut hull) = span(&points) {
                while let Some(next) = collapse_an_edge(&hull) {
                    prop_assert!(next.vertices.len() < hull.vertices.len());
                    hull = next;
                    for &face in &hull.faces {
                        let plane = Plane::through(hull.triangle(face)).unwrap();
                        for &point in &points {
                            prop_assert!(plane.distance(point) < 1e-9, "{point} of {points:?}");
                        }
                    }
                }
            }
        }

        /// Any cloud has a palette of finite colors, with as few corners as requested or as possible.
        #[test]
        fn any_cloud_has_corners(points in prop_oneof![lattice(), cloud()], max_corners in 1usize..12) {
            let simplified = simplify(&points, max_corners);
            let corners = simplified.corners(max_corners);
            prop_assert!(!corners.is_empty());
            prop_assert!(corners.len() <= simplified.before());
            prop_assert!(corners.iter().all(|corner| corner.is_finite()));
            let collapses = match span(corners) {
                Span::Solid(hull) => collapse_an_edge(&hull).is_some(),
                // Two corners are a line, and four may be a parallelogram.
                _ => corners.len() > 4,
            };
            prop_assert!(corners.len() <= max_corners || !collapses, "{corners:?}");
            // The simplest shape comes after those with more corners.
            let simplest = simplify(&points, 1);
            prop_assert_eq!(simplest.corners(max_corners), corners);
        }

        /// The optimum is the best corner of the region that the planes bound, found by trying all triples of planes.
        #[test]
        fn linear_programs_are_solved(normals in prop::collection::vec(prop::array::uniform3(-1.0..1.0f64), 3..10)) {
            let normals: Vec<DVec3> = normals.into_iter().map(DVec3::from_array).collect();
            prop_assume!(normals.iter().all(|normal| normal.length() > 0.1));
            // Planes that touch a ball, all but one with normals in the same half-space: often feasible.
            let planes: Vec<Plane> = normals
                .iter()
                .enumerate()
                .map(|(i, n)| (if n.z < 0.0 && i > 0 { -*n } else { *n }).normalize())
                .map(|normal| Plane { normal, offset: 1.0 })
                .collect();
            let mut best = f64::INFINITY;
            for (i, a) in planes.iter().enumerate() {
                for (j, b) in planes.iter().enumerate().skip(i + 1) {
                    for c in &planes[j + 1..] {
                        let rows = glam::DMat3::from_cols(a.normal, b.normal, c.normal).transpose();
                        if rows.determinant().abs() > 1e-9 {
                            let point = rows.inverse() * DVec3::ONE;
                            if planes.iter().all(|plane| plane.distance(point) > -1e-9) {
                                best = best.min(planes.iter().map(|plane| plane.distance(point)).sum());
                            }
                        }
                    }
                }
            }
            let sum = |point: DVec3| planes.iter().map(|plane| plane.distance(point)).sum::<f64>();
            let found = nearest_outside(&planes, &Progress::default()).map_or(f64::INFINITY, sum);
            prop_assert!(found == best || (found - best).abs() < 1e-6 * (1.0 + best), "{found} {best}");
        }
    }

    /// No edge of a tetrahedron can collapse, and a hull that already has few corners is left unchanged.
    #[test]
    fn simple_hulls_are_unchanged() {
        let tetrahedron = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        assert_eq!(simplify(&tetrahedron, 1).corners(1).len(), 4);
        let octahedron = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| [axis, -axis]).concat();
        let corners = simplify(&octahedron, 6).corners(6).to_vec();
        assert!(corners.len() == 6 && octahedron.iter().all(|corner| corners.contains(corner)));
    }

    /// Every edge of a box touches two parallel faces on opposite sides, and no point is outside both. No edge has an
    /// optimum, even with a corner of the box cut off. Here the paper's method ends with more corners than requested.
    #[test]
    fn boxes_are_unchanged() {
        let corners: Vec<DVec3> =
            (0..8).map(|i| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2))).collect();
        assert_eq!(simplify(&corners, 6).corners(6).len(), 8);
        assert_eq!(simplify(&corners[1..], 6).corners(6).len(), 7);
    }

    /// The only corner that could replace the last edge is 30,000 away, where rounding would cut off a point by 8e-9,
    /// so the edge stays.
    #[test]
    fn far_corners_do_not_cut_off_colors() {
        let points = [
            [7, 1, 3],
            [1, 9, 3],
            [7, 11, 1],
            [11, 9, 7],
            [3, 3, 7],
            [3, 9, 11],
            [1, 5, 9],
            [7, 11, 11],
            [5, 1, 3],
            [3, 11, 11],
            [3, 3, 1],
            [11, 3, 7],
            [11, 5, 11],
            [7, 3, 11],
            [1, 5, 7],
            [11, 3, 1],
        ];
        let points = points.map(|p| DVec3::from_array(p.map(f64::from)) / 16.0);
        let Span::Solid(simplified) = span(simplify(&points, 4).corners(4)) else {
            unreachable!("a cloud with a volume")
        };
        assert!(simplified.contains(&points));
    }

    /// Collapsing an edge restores a corner of a tetrahedron that was cut off, since this adds the least volume.
    #[test]
    fn a_cut_corner_grows_back() {
        let cut = 0.9;
        let points = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z * cut];
        let points = [&points[..], &[DVec3::new(1.0 - cut, 0.0, cut), DVec3::new(0.0, 1.0 - cut, cut)]].concat();
        let mut corners = simplify(&points, 4).corners(4).to_vec();
        corners.sort_by(|a, b| a.z.total_cmp(&b.z));
        assert!(corners[3].distance(DVec3::Z) < 1e-12, "{corners:?}");
    }

    #[test]
    fn flat_clouds_keep_their_corners() {
        let corner = DVec3::splat(0.25);
        assert_eq!(simplify(&[corner; 5], 6).corners(6), [corner]);
        assert_eq!(simplify(&[corner, DVec3::ONE, DVec3::splat(0.5)], 6).corners(6), [corner, DVec3::ONE]);
        let square = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::X + DVec3::Y, DVec3::X * 0.5];
        assert_eq!(simplify(&square, 6).corners(6).len(), 4);
        let circle: Vec<DVec3> = (0..20).map(|i| DVec3::new(f64::from(i).sin(), f64::from(i).cos(), 0.5)).collect();
        let simplified = simplify(&circle, 6);
        assert_eq!((simplified.before(), simplified.corners(6).len()), (20, 6));
    }
}
