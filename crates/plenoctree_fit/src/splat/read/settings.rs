//! Settings for reading captures: what their files do not record.

use serde::{Deserialize, Serialize};

/// Settings for reading captures: what their files do not record.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SplatSettings {
    /// The axes of an SPZ file that does not record them. [`SpzAxes::Unknown`] by default.
    pub spz_axes: SpzAxes,
}

/// The axes of an SPZ file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum SpzAxes {
    /// Not known. Right, up and back are assumed, and [`Splats::assumes_axes`](crate::splat::Splats::assumes_axes) says
    /// so. The default.
    #[default]
    Unknown,
    /// Right, up and back, as the format specifies.
    RightUpBack,
    /// Those of `.ply` files: right, down and front. splat-transform 3, SuperSplat and Niantic's `ply_to_spz` write such
    /// files.
    RightDownFront,
}
