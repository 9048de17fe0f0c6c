//! The field while it is fitted: a sparse grid of cells. A voxel is a cube of 1, 2 or 4 cells per side.
//!
//! Cells are stored in bricks of 4 x 4 x 4. A brick's bit masks record which of its cells are part of a voxel, and
//! which of these are the lowest of their voxel. Voxels are numbered brick by brick, so that neighbors in space are
//! mostly neighbors in memory.

mod build;
mod march;
mod sparse;

pub use build::VoxelSet;
pub use march::Crossing;
pub use sparse::{Cube, Grid, NO_VOXEL, Voxel};
