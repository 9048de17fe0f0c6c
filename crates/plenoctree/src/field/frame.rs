//! Where a field lies: its tree's cube, and which way is up.

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
    /// Bevy's convention: nothing is turned.
    Y,
    /// NeRF's convention: a prop's field is turned by -90 degrees about x.
    #[default]
    Z,
}

impl UpAxis {
    /// The turn that makes the up axis y: from a field's frame to that of its prop.
    pub fn to_y_up(self) -> DMat3 {
        match self {
            Self::Y => DMat3::IDENTITY,
            // -90 degrees about x, exactly.
            Self::Z => DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y),
        }
    }
}

/// Where the tree's unit cube lies: `tree = offset + scale * world`, axis by axis. "World" is the field's own frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// `offset` of the file.
    pub offset: DVec3,
    /// `invradius3` of the file: the tree's length of one world unit on each axis. Positive.
    pub scale: DVec3,
}

impl Frame {
    /// The frame in which the cube spans `min` to `max`.
    pub fn spanning(min: DVec3, max: DVec3) -> Self {
        let scale = (max - min).recip();
        Self { offset: -min * scale, scale }
    }

    /// A point of the field's frame in the tree's unit cube.
    pub fn to_tree(&self, world: DVec3) -> DVec3 {
        self.offset + self.scale * world
    }

    /// A point of the tree's unit cube in the field's frame.
    pub fn to_world(&self, tree: DVec3) -> DVec3 {
        (tree - self.offset) / self.scale
    }
}
