//! The field while it is fitted: a sparse grid of cubic voxels that all have the same size.
//!
//! Voxels are stored in bricks of 4 x 4 x 4. A brick's bit mask records which of its voxels exist. Voxels are numbered
//! brick by brick, so that neighbors in space are mostly neighbors in memory.

mod build;
mod march;
mod sparse;

pub use build::VoxelSet;
pub use sparse::{Cube, Grid, NO_VOXEL};
