//! Marches a single ray from a leaf to the edge of the field.

use std::ops::ControlFlow;

use glam::DVec3;

use super::sample_point::SamplePoint;
use crate::field::{LeafCell, PlenOctree};

/// Returns the optical depth (the integral of density) from a point of `leaf` to the edge of the field, on the way from
/// the leaf's center. If it is more than `limit`, returns some value greater than `limit`.
///
/// `direction` is in finest cells per world unit.
pub(super) fn optical_depth(
    field: &PlenOctree,
    leaf: LeafCell,
    direction: DVec3,
    from: SamplePoint,
    limit: f64,
) -> f64 {
    let center = leaf.corner.as_dvec3() + 0.5 * f64::from(leaf.size);
    let mut depth = 0.0;
    field.march_cells(center, direction, |crossing| {
        if from == SamplePoint::Center || crossing.leaf != leaf.leaf {
            depth += f64::from(field.densities()[crossing.leaf as usize]) * crossing.length;
        }
        if depth > limit { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    depth
}
