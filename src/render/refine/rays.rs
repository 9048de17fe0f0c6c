//! The rays that a pass marches, and where their results are.

use bevy::prelude::*;

/// The pixels along a side of a square whose pixels form a batch. Matches `batch.wgsl`.
pub(in crate::render) const BATCH: u32 = 32;

/// Which rays a pass marches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::render) enum RaysOf {
    /// Those of the grid. If its spacing is one, these are the rays of all pixels.
    Grid,
    /// Those of the batches.
    Batches,
}

/// Returns the size of the textures in which the batches of a viewport of `size` are drawn.
pub(in crate::render) fn batches_size(size: UVec2) -> UVec2 {
    (size + BATCH - 1) / BATCH * BATCH
}
