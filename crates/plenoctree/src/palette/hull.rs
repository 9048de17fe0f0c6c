//! Convex hulls of clouds of colors.
//!
//! Exact arithmetic decides on which side of a face a point is, so hulls are valid even for the degenerate clouds that
//! come from lattices of bins. A point closer than [`ROUNDING`] to the hull of the others is not a corner, because
//! hulls are built repeatedly from corners that were computed to lie on planes of the previous hull.

use glam::DVec3;
use robust::{Coord3D, orient3d};

use crate::sampling::Progress;

/// Upper limit of lengths in RGB that are due to rounding.
pub(super) const ROUNDING: f64 = 1e-11;

/// Thickness below which a cloud has no volume, area or length.
const FLAT: f64 = 1e-9;

/// The shape that points span.
#[derive(Clone, Debug)]
pub(super) enum Span {
    /// A point, or the two ends of a line.
    Corners(Vec<DVec3>),
    /// An area in the plane of points `.0[0] + u .0[1] + v .0[2]`. `.1` holds (u, v) of every given point.
    Plane([DVec3; 3], Vec<glam::DVec2>),
    /// A volume.
    Solid(Hull),
}

/// A convex polyhedron with triangular faces.
#[derive(Clone, Debug)]
pub(super) struct Hull {
    /// All corners of the hull, and no other points.
    pub vertices: Vec<DVec3>,
    /// Faces as indices of corners, counterclockwise as seen from outside.
    pub faces: Vec<[usize; 3]>,
}

/// A plane with a unit normal: `normal . x = offset`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    pub normal: DVec3,
    pub offset: f64,
}

impl Plane {
    /// Returns the plane through three points, which are counterclockwise as seen from its positive side, or `None` if
    /// they are on a line.
    pub fn through([a, b, c]: [DVec3; 3]) -> Option<Self> {
        let normal = (b - a).cross(c - a).try_normalize()?;
        Some(Self { normal, offset: normal.dot(a) })
    }

    /// Returns the signed distance of a point.
    pub fn distance(&self, point: DVec3) -> f64 {
        self.normal.dot(point) - self.offset
    }
}

/// Returns the shape that `points` span. There must be at least one point, and all must be finite.
///
/// Once `progress` is canceled, returns the shape that it has reached.
pub(super) fn span(points: &[DVec3], progress: &Progress) -> Span {
    let first = farthest(points, |p| -p.x);
    let second = farthest(points, |p| p.distance(first));
    let Some(along) = (second - first).try_normalize().filter(|_| second.distance(first) > FLAT) else {
        return Span::Corners(vec![first]);
    };
    let off_line = |p: DVec3| (p - first).reject_from_normalized(along);
    let third = farthest(points, |p| off_line(p).length());
    let Some(across) = off_line(third).try_normalize().filter(|_| off_line(third).length() > FLAT) else {
        return Span::Corners(vec![first, second]);
    };
    let normal = along.cross(across);
    let fourth = farthest(points, |p| normal.dot(p - first).abs());
    if normal.dot(fourth - first).abs() <= FLAT {
        let flat = |&p: &DVec3| glam::DVec2::new(along.dot(p - first), across.dot(p - first));
        return Span::Plane([first, along, across], points.iter().map(flat).collect());
    }
    let mut hull = build([first, second, third, fourth], points, progress);
    match hull.flattest_corner(progress) {
        Some(flattest) => {
            hull.vertices.remove(flattest);
            span(&hull.vertices, progress)
        }
        None => Span::Solid(hull),
    }
}

/// Returns the point where `measure` is largest. Ties go to the largest coordinates, so the point is a corner if the
/// measure is linear.
fn farthest(points: &[DVec3], measure: impl Fn(DVec3) -> f64) -> DVec3 {
    let key = |p: DVec3| [measure(p), p.x, p.y, p.z];
    points.iter().copied().reduce(|best, p| if key(p) > key(best) { p } else { best }).unwrap_or_default()
}

/// Returns the height of `point` over the plane of a face, up to a positive factor. Its sign is exact.
fn above([a, b, c]: [DVec3; 3], point: DVec3) -> f64 {
    let coord = |p: DVec3| Coord3D { x: p.x, y: p.y, z: p.z };
    -orient3d(coord(a), coord(b), coord(c), coord(point))
}

/// Builds the hull of a tetrahedron and more points: adds the farthest point outside until there is none left.
fn build(mut tetrahedron: [DVec3; 4], points: &[DVec3], progress: &Progress) -> Hull {
    if above([tetrahedron[0], tetrahedron[1], tetrahedron[2]], tetrahedron[3]) > 0.0 {
        tetrahedron.swap(0, 1);
    }
    let mut hull = Hull { vertices: tetrahedron.to_vec(), faces: vec![[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]] };
    let mut outside = points.to_vec();
    loop {
        let planes: Vec<Plane> = hull.faces.iter().filter_map(|&face| Plane::through(hull.triangle(face))).collect();
        let height = |p: DVec3| planes.iter().map(|plane| plane.distance(p)).fold(f64::NEG_INFINITY, f64::max);
        outside.retain(|&p| height(p) > ROUNDING);
        if outside.is_empty() || progress.is_canceled() {
            break;
        }
        let next = farthest(&outside, height);
        outside.retain(|&p| p != next);
        hull.add(next);
    }
    hull.drop_unused()
}

impl Hull {
    /// Returns the corners of a face.
    pub fn triangle(&self, face: [usize; 3]) -> [DVec3; 3] {
        face.map(|corner| self.vertices[corner])
    }

    /// Returns whether all points are inside the hull, with a tolerance for rounding.
    pub fn contains(&self, points: &[DVec3]) -> bool {
        let planes = self.faces.iter().filter_map(|&face| Plane::through(self.triangle(face)));
        planes.flat_map(|plane| points.iter().map(move |&p| plane.distance(p))).all(|height| height <= 10.0 * ROUNDING)
    }

    /// Adds a point outside the hull: replaces the faces that it sees by a cone over their rim.
    fn add(&mut self, point: DVec3) {
        let (seen, mut faces): (Vec<_>, Vec<_>) =
            self.faces.iter().partition(|&&face| above(self.triangle(face), point) > 0.0);
        let edges: Vec<(usize, usize)> = seen.iter().flat_map(|&face| edges(face)).collect();
        let index = self.vertices.len();
        let rim = edges.iter().filter(|&&(a, b)| !edges.contains(&(b, a)));
        faces.extend(rim.map(|&(a, b)| [a, b, index]));
        self.vertices.push(point);
        self.faces = faces;
    }

    /// Drops vertices that no face uses any longer.
    fn drop_unused(self) -> Self {
        let mut used = vec![false; self.vertices.len()];
        self.faces.iter().flatten().for_each(|&corner| used[corner] = true);
        let mut index = vec![0; used.len()];
        let mut vertices = Vec::new();
        for (old, &point) in self.vertices.iter().enumerate().filter(|&(old, _)| used[old]) {
            index[old] = vertices.len();
            vertices.push(point);
        }
        Self { vertices, faces: self.faces.iter().map(|face| face.map(|corner| index[corner])).collect() }
    }

    /// Returns the corner with the smallest height above the hull of all others, if that is within rounding.
    fn flattest_corner(&self, progress: &Progress) -> Option<usize> {
        let mut neighbors = vec![Vec::new(); self.vertices.len()];
        for &face in &self.faces {
            edges(face).iter().for_each(|&(a, b)| neighbors[a].push(self.vertices[b]));
        }
        (0..self.vertices.len())
            .map(|corner| (prominence(self.vertices[corner], &neighbors[corner], progress), corner))
            .filter(|&(height, _)| height <= ROUNDING)
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, corner)| corner)
    }
}

/// Returns the three directed edges of a face.
pub(super) fn edges([a, b, c]: [usize; 3]) -> [(usize, usize); 3] {
    [(a, b), (b, c), (c, a)]
}

/// Returns how far a corner is outside the hull of its neighbors, which would close the gap if the corner were removed.
///
/// This is its height over the highest plane through three neighbors that has all others on its other side. Once
/// `progress` is canceled, it is infinite.
fn prominence(corner: DVec3, neighbors: &[DVec3], progress: &Progress) -> f64 {
    let mut highest = 0.0f64;
    for (i, &a) in neighbors.iter().enumerate() {
        for (j, &b) in neighbors.iter().enumerate().skip(i + 1) {
            if progress.is_canceled() {
                return f64::INFINITY;
            }
            for &c in &neighbors[j + 1..] {
                let Some(mut plane) = Plane::through([a, b, c]) else { continue };
                if plane.distance(corner) < 0.0 {
                    plane = Plane { normal: -plane.normal, offset: -plane.offset };
                }
                let height = plane.distance(corner);
                if height > highest && neighbors.iter().all(|&p| plane.distance(p) <= ROUNDING) {
                    highest = height;
                    if highest > ROUNDING {
                        return highest;
                    }
                }
            }
        }
    }
    highest
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Points on a coarse lattice: many coincide, or lie on common lines and planes.
    fn lattice() -> impl Strategy<Value = Vec<DVec3>> {
        let point =
            prop::array::uniform3(0..4u8).prop_map(|p| DVec3::from_array(p.map(|x| (f64::from(x) + 0.5) / 8.0)));
        prop::collection::vec(point, 1..60)
    }

    fn cloud() -> impl Strategy<Value = Vec<DVec3>> {
        prop::collection::vec(prop::array::uniform3(0.0..1.0f64).prop_map(DVec3::from_array), 1..60)
    }

    fn solid(points: &[DVec3]) -> Option<Hull> {
        match span(points, &Progress::default()) {
            Span::Solid(hull) => Some(hull),
            _ => None,
        }
    }

    proptest! {
        /// A hull is closed, has the topology of a ball, contains all points, and only has given points as corners.
        #[test]
        fn hulls_are_closed_and_contain_all_points(points in prop_oneof![lattice(), cloud()]) {
            if let Some(hull) = solid(&points) {
                let edges: Vec<_> = hull.faces.iter().flat_map(|&face| edges(face)).collect();
                prop_assert!(edges.iter().all(|&(a, b)| edges.iter().filter(|&&edge| edge == (b, a)).count() == 1));
                prop_assert_eq!(hull.vertices.len() + hull.faces.len(), edges.len() / 2 + 2);
                for &face in &hull.faces {
                    let plane = Plane::through(hull.triangle(face)).unwrap();
                    prop_assert!(points.iter().all(|&p| plane.distance(p) < 1e-9));
                }
                prop_assert!(hull.vertices.iter().all(|corner| points.contains(corner)));
            }
        }

        /// Without any one of its corners, the hull is smaller.
        #[test]
        fn no_corner_is_redundant(points in lattice()) {
            if let Some(hull) = solid(&points) {
                for corner in 0..hull.vertices.len() {
                    let mut rest = hull.vertices.clone();
                    let corner = rest.remove(corner);
                    if let Some(rest) = solid(&rest) {
                        let outside = |&face: &[usize; 3]| above(rest.triangle(face), corner) > 0.0;
                        prop_assert!(rest.faces.iter().any(outside), "{corner}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_full_lattice_has_eight_corners() {
        let coordinates = (0..512).map(|i| DVec3::new(f64::from(i / 64), f64::from(i / 8 % 8), f64::from(i % 8)) * 0.1);
        let hull = solid(&coordinates.collect::<Vec<_>>()).unwrap();
        assert_eq!((hull.vertices.len(), hull.faces.len()), (8, 12));
    }

    /// Rounding may lift a point above an edge, or beside a corner. This does not make it a corner.
    #[test]
    fn rounding_makes_no_corners() {
        let mut points = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        points.extend([DVec3::new(0.5, 0.5, 1e-13), DVec3::new(0.3, 0.7, -1e-12), DVec3::new(1.0, 1e-12, -1e-12)]);
        points.extend([DVec3::new(-1e-12, 0.4, 0.4), DVec3::splat(1.0 / 3.0) + 1e-13]);
        assert_eq!(solid(&points).unwrap().vertices.len(), 4);
    }

    #[test]
    fn flat_clouds_are_told_apart() {
        let point = DVec3::new(0.1, 0.2, 0.3);
        let line = [point, point + 0.3 * DVec3::ONE, point - 0.1 * DVec3::ONE, point];
        let span = |points: &[DVec3]| span(points, &Progress::default());
        assert!(matches!(span(&[point, point]), Span::Corners(corners) if corners == [point]));
        assert!(matches!(span(&line), Span::Corners(corners) if corners == [line[2], line[1]]));
        let plane = [point, point + DVec3::X, point + DVec3::new(0.3, 0.5, 1e-10), point + DVec3::Y];
        assert!(matches!(span(&plane), Span::Plane(_, flat) if flat.len() == 4));
    }
}
