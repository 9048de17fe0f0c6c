//! Normals in volumes, which have no surface.

use glam::{DVec3, IVec3};

use crate::field::PlenOctree;

/// Radius of the neighborhood, in lattice steps.
const RADIUS: f64 = 4.5;
/// Radius in whole steps. Cells farther away have no weight.
const REACH: i32 = 4;
/// Radius of the neighborhood, in multiples of the length over which transmittance falls to 1/e.
const DEPTHS: f64 = 1.5;
/// Maximum lattice step, in finest cells.
const WIDEST: f64 = 16.0;

/// Returns the direction in which opacity falls off around `point`, or `None` if it is the same all around.
///
/// This is the negative gradient of the cells' opacity, smoothed with a kernel that falls off to 0. The kernel spans a
/// few cells, enough to smooth the staircase of a hard surface. In thin fog, judged by `density`, it grows until it
/// reaches out of the fog.
pub(super) fn normal_at(field: &PlenOctree, point: DVec3, density: f64) -> Option<DVec3> {
    let cells = f64::from(1u32 << field.depth());
    let frame = field.frame();
    let width = 1.0 / (frame.scale.min_element() * cells);
    let step = (DEPTHS / (density * width * RADIUS)).clamp(1.0, WIDEST).round();
    // In lattice steps. The lattice does not move with the point, so the normal changes smoothly.
    let at = frame.to_tree(point) * cells / step;
    let origin = at.floor();

    let (mut weights, mut opacities) = (0.0, 0.0);
    let (mut offsets, mut moments) = (DVec3::ZERO, DVec3::ZERO);
    for index in 0..(2 * REACH + 1).pow(3) {
        let side = 2 * REACH + 1;
        let offset = IVec3::new(index / (side * side), index / side % side, index % side) - REACH;
        let center = origin + offset.as_dvec3() + 0.5;
        let away = center - at;
        let weight = 1.0 - away.length_squared() / (RADIUS * RADIUS);
        if weight <= 0.0 {
            continue;
        }
        let opacity = -(-density_at(field, center * step) * step * width).exp_m1();
        weights += weight;
        opacities += weight * opacity;
        offsets += weight * away;
        moments += weight * opacity * away;
    }
    // Subtract the mean offset, which would be 0 if not for the lattice.
    let gradient = moments / opacities - offsets / weights;
    if gradient.length() > 1e-9 { (-gradient * frame.scale).try_normalize() } else { None }
}

/// Returns the density at a point in finest cells, 0 outside the field.
fn density_at(field: &PlenOctree, point: DVec3) -> f64 {
    let cells = f64::from(1u32 << field.depth());
    if point.min_element() < 0.0 || point.max_element() >= cells {
        return 0.0;
    }
    let (cell, ..) = field.locate(point.as_uvec3());
    cell.as_leaf().map_or(0.0, |leaf| f64::from(field.densities()[leaf as usize]))
}
