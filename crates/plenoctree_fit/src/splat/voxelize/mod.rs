//! Converts a capture to a field: adds up the optical depth of its Gaussians in small cells, and merges cells where that
//! does not show.

mod blocks;
mod cells;
mod coarse;
mod colors;
mod gaussian;
mod optics;
mod sight;
mod tree;
mod voxels;

use glam::DVec3;
use plenoctree::PlenOctree;

pub use self::voxels::Voxels;
use super::{error::SplatError, splats::Splats};

/// Thickness below which a finest cell is empty.
const THINNEST: f32 = 1e-3;

/// Settings of [`voxelize`].
#[derive(Clone, Debug, PartialEq)]
pub struct VoxelSettings {
    /// Number of levels of cells, 6 to 10: the finest cells are `2^-depth` of the field's cube wide. 10 by default. If
    /// nearly the whole cube is full, cells are at most 9 levels deep.
    pub depth: u32,
    /// The largest number of leaves, 32768 to 20,000,000. 3 million by default.
    pub leaves: usize,
    /// All leaves are finest cells, as refining needs them, and their number is not limited by `leaves`. Off by default.
    pub uniform: bool,
    /// Lowest and highest corner of the box to convert. By default, it is [`Splats::dense_bounds`]. The field's cube is
    /// around it.
    pub bounds: Option<(DVec3, DVec3)>,
}

impl Default for VoxelSettings {
    /// Depth 10, at most 3 million leaves of any size.
    fn default() -> Self {
        Self { depth: 10, leaves: 3_000_000, uniform: false, bounds: None }
    }
}

/// Converts a capture to a field, in the capture's coordinates, on all cores of the current rayon pool. The field is
/// the same on any number of threads.
///
/// Seen from outside, the field looks like the capture. Leaves are small where the capture shows detail, and large where
/// it does not; what is hidden is left out. Its colors use [`Activation::Sigmoid`](crate::Activation::Sigmoid), the
/// default for files that record none, with harmonics up to degree 2.
///
/// # Errors
///
/// Returns an error if a setting is out of range, if no Gaussian in the box is visible, or if there are too many cells
/// for memory.
pub fn voxelize(splats: &Splats, settings: &VoxelSettings) -> Result<PlenOctree, SplatError> {
    Voxels::new(splats, settings)?.field(settings.leaves)
}
