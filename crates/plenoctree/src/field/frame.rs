//! The frame of a field: the position of its tree's cube, and its up axis.

#[cfg(feature = "bevy")]
use bevy_reflect::std_traits::ReflectDefault;
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

/// The axis of the field's frame that points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(
    feature = "bevy",
    derive(bevy_reflect::Reflect),
    reflect(Default, Clone, Debug, PartialEq, Hash),
    type_path = "plenoctree"
)]
pub enum UpAxis {
    /// Bevy's convention. A prop's field is not rotated.
    Y,
    /// NeRF's convention, the default. A prop's field is rotated by -90 degrees about x.
    #[default]
    Z,
}

impl UpAxis {
    /// Returns the rotation that turns the up axis to y: from a field's frame to the frame of its prop.
    pub fn to_y_up(self) -> DMat3 {
        match self {
            Self::Y => DMat3::IDENTITY,
            // Exactly -90 degrees about x.
            Self::Z => DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y),
        }
    }
}

/// The position and size of the tree's unit cube: `tree = offset + scale * world`, per axis.
///
/// "World" is the field's own frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Offset in tree units: `offset` in files.
    pub offset: DVec3,
    /// Tree units per world unit on each axis: `invradius3` in files. Positive.
    pub scale: DVec3,
}

impl Frame {
    /// Creates the frame in which the cube spans `min` to `max`, in world units.
    pub fn spanning(min: DVec3, max: DVec3) -> Self {
        let scale = (max - min).recip();
        Self { offset: -min * scale, scale }
    }

    /// Transforms a point from the field's frame to the tree's unit cube.
    pub fn to_tree(&self, world: DVec3) -> DVec3 {
        self.offset + self.scale * world
    }

    /// Transforms a point from the tree's unit cube to the field's frame.
    pub fn to_world(&self, tree: DVec3) -> DVec3 {
        (tree - self.offset) / self.scale
    }
}
