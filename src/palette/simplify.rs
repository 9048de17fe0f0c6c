//! Simplification of convex hulls, step 8 of section 3 of the method.
//!
//! The linear programmes have three unknowns and a dozen constraints. They are solved by walking all lines in which two
//! constraints meet: exact where general solvers stop at a tolerance, which here would cut off colours.

use glam::DVec3;

use super::{
    hull::{Hull, Plane, ROUNDING, Span, edges, span},
    polygon,
};

/// The corners of a simple shape that contains all points.
#[derive(Clone, Debug)]
pub(super) struct Simplified {
    /// The corners, at most as many as were wanted unless no edge could be collapsed any more.
    pub corners: Vec<DVec3>,
    /// The number of corners before simplification.
    pub before: usize,
}

/// Simplifies the convex hull of `points` to `wanted` corners. There must be a point; all must be finite.
///
/// The result may leave the RGB cube. Points without volume have no hull, but span something that has corners: a point,
/// a line or a polygon, which is simplified as hulls are.
pub(super) fn simplify(points: &[DVec3], wanted: usize) -> Simplified {
    match span(points) {
        Span::Corners(corners) => Simplified { before: corners.len(), corners },
        Span::Plane([origin, along, across], flat) => {
            let corners = polygon::corners(&flat);
            let before = corners.len();
            let corners = polygon::simplify(corners, wanted);
            Simplified { corners: corners.iter().map(|p| origin + p.x * along + p.y * across).collect(), before }
        }
        Span::Solid(mut hull) => {
            let before = hull.vertices.len();
            while hull.vertices.len() > wanted
                && let Some(next) = collapse_an_edge(&hull)
            {
                hull = next;
            }
            Simplified { corners: hull.vertices, before }
        }
    }
}

/// Replaces the edge whose collapse adds the least volume by a corner; `None` if no edge can be collapsed.
fn collapse_an_edge(hull: &Hull) -> Option<Hull> {
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
        let Some(corner) = nearest_outside(&planes) else { continue };
        let volume: f64 = touching.iter().map(|(plane, area)| plane.distance(corner).abs() * area / 3.0).sum();
        if best.is_none_or(|(least, ..)| volume < least) {
            best = Some((volume, (a, b), corner));
        }
    }
    let (_, (a, b), corner) = best?;
    let kept = (0..hull.vertices.len()).filter(|&vertex| vertex != a && vertex != b);
    let points: Vec<DVec3> = kept.map(|vertex| hull.vertices[vertex]).chain([corner]).collect();
    match span(&points) {
        // A hull that does not shrink would be collapsed for ever.
        Span::Solid(next) if next.vertices.len() < hull.vertices.len() => Some(next),
        _ => None,
    }
}

/// The point on the positive side of all planes with the smallest sum of distances to them, if there is any.
///
/// Such a point is a corner of what the planes bound. In every line where two planes meet, the others leave an interval,
/// whose ends are corners.
fn nearest_outside(planes: &[Plane]) -> Option<DVec3> {
    let mut best: Option<(f64, DVec3)> = None;
    for (i, first) in planes.iter().enumerate() {
        for (j, second) in planes.iter().enumerate().skip(i + 1) {
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
