//! The rays that a pass marches, and where their results are.

use bevy::prelude::*;

/// The pixels along a side of the square in which a batch is drawn. Matches `batch.wgsl`.
pub(in crate::render) const BATCH: u32 = 32;

/// The largest number of gaps in a batch. Matches `batch.wgsl`.
pub(super) const MOST_GAPS: u32 = 256;

/// Which rays a pass marches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::render) enum RaysOf {
    /// Those of the grid. If its spacing is one, these are the rays of all pixels.
    Grid,
    /// Those of the batches.
    Batches,
}

/// Returns the pixels along a side of the square of the viewport whose gaps form a batch.
pub(in crate::render) fn batch_side(spacing: u32) -> u32 {
    BATCH / spacing * spacing
}

/// Returns the numbers of batches of a viewport of `size`, along each axis.
pub(in crate::render) fn batches(size: UVec2, spacing: u32) -> UVec2 {
    (size + batch_side(spacing) - 1) / batch_side(spacing)
}

/// Returns the size of the textures in which they are drawn.
pub(in crate::render) fn batches_size(size: UVec2, spacing: u32) -> UVec2 {
    BATCH * batches(size, spacing)
}
