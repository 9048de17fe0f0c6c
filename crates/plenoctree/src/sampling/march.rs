//! Marches a single ray through the octree, cell by cell.

use glam::DVec3;

use super::sample_point::SamplePoint;
use crate::field::{LeafCell, PlenOctree};

/// Returns the optical depth (the integral of density) from a point of `leaf` to the edge of the field, on the way from
/// the leaf's center. If it is more than `limit`, returns some value greater than `limit`.
///
/// `direction` is in finest cells per world unit. Positions are counted in whole cells, so no cell is skipped or
/// visited twice, however small it is, and path lengths are exact.
pub(super) fn optical_depth(
    field: &PlenOctree,
    leaf: LeafCell,
    direction: DVec3,
    from: SamplePoint,
    limit: f64,
) -> f64 {
    let origin = leaf.corner.as_dvec3() + 0.5 * f64::from(leaf.size);
    let forward = direction.cmpge(DVec3::ZERO);
    let per_cell = direction.abs().recip();
    let end = 1u32 << field.depth();
    let (mut corner, mut size) = (leaf.corner, leaf.size);
    let mut depth = 0.0;
    let mut density = match from {
        SamplePoint::Center => f64::from(field.densities()[leaf.leaf as usize]),
        SamplePoint::Entry => 0.0,
    };
    let mut traveled = 0.0;
    loop {
        let far = DVec3::select(forward, (corner + size).as_dvec3(), corner.as_dvec3());
        let exits = (far - origin).abs() * per_cell;
        let exit = exits.min_element();
        depth += density * (exit - traveled).max(0.0);
        if depth > limit {
            return depth;
        }
        traveled = exit.max(traveled);
        let axis = exits.to_array().iter().position(|&t| t == exit).unwrap_or(0);
        let mut position = (origin + direction * traveled).as_uvec3().clamp(corner, corner + (size - 1));
        if forward.test(axis) {
            position[axis] = corner[axis] + size;
        } else if corner[axis] > 0 {
            position[axis] = corner[axis] - 1;
        } else {
            return depth;
        }
        if position[axis] >= end {
            return depth;
        }
        let cell;
        (cell, corner, size) = field.locate(position);
        density = cell.as_leaf().map_or(0.0, |leaf| f64::from(field.densities()[leaf as usize]));
    }
}
