//! The visible extent of a field.

use bevy::math::Vec3;
use bevy_plenoctree::PlenOctree;

/// A box in a prop's space.
#[derive(Clone, Copy)]
pub struct Extent {
    pub center: Vec3,
    pub half_size: Vec3,
}

/// Returns the box that contains most of a field, or `None` if the field is empty.
pub fn visible_extent(field: &PlenOctree) -> Option<Extent> {
    let (low, high) = field.dense_bounds()?;
    let (a, b) = (field.up().to_y_up() * low, field.up().to_y_up() * high);
    Some(Extent { center: (0.5 * (a + b)).as_vec3(), half_size: (0.5 * (b - a)).abs().as_vec3() })
}
