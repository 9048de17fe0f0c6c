//! Settings for reading captures: what their files do not record.

use serde::{Deserialize, Serialize};

/// Settings for reading captures: what their files do not record.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SplatSettings {
    /// The axes of an SPZ file that does not record them. [`SpzAxes::RightUpBack`] by default.
    pub spz_axes: SpzAxes,
}

/// The axes of an SPZ file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum SpzAxes {
    /// Right, up and back, as the format specifies. The default.
    #[default]
    RightUpBack,
    /// Those of `.ply` files: right, down and front. splat-transform 3 writes such files.
    RightDownFront,
}
