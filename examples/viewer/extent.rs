//! Where a field has something to see.

use bevy::math::{DVec3, Vec3};
use bevy_plenoctree::{PlenOctree, field::UpAxis};

/// A box in a prop's space.
#[derive(Clone, Copy)]
pub struct Extent {
    pub center: Vec3,
    pub half_size: Vec3,
}

/// The box in which most of a field lies; `None` if it is empty.
pub fn visible_extent(field: &PlenOctree) -> Option<Extent> {
    let (low, high) = field.dense_bounds()?;
    let (a, b) = (to_prop(field.up(), low), to_prop(field.up(), high));
    Some(Extent { center: (0.5 * (a + b)).as_vec3(), half_size: (0.5 * (b - a)).abs().as_vec3() })
}

/// A prop is its field with the up axis turned to y.
fn to_prop(up: UpAxis, point: DVec3) -> DVec3 {
    match up {
        UpAxis::Y => point,
        UpAxis::Z => DVec3::new(point.x, point.z, -point.y),
    }
}
