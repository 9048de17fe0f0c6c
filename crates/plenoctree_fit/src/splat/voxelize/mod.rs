//! Converts a capture to a field: adds up the optical depth of its Gaussians in small cells, and merges cells where
//! that does not show.

mod areas;
mod blocks;
mod choice;
mod coarse;
mod colors;
mod gaussian;
mod optics;
mod parts;
mod place;
mod settings;
mod sight;
mod voxels;

use plenoctree::PlenOctree;

pub use self::{settings::VoxelSettings, voxels::Voxels};
use super::{error::SplatError, splats::Splats};

/// Converts a capture to a field, in the capture's coordinates, on all cores of the current rayon pool. The field is
/// the same on any number of threads.
///
/// The field looks about like the capture. Its colors use [`Activation::Sigmoid`](plenoctree::Activation::Sigmoid), the
/// default for files that record none, with harmonics up to degree 2.
///
/// # Errors
///
/// Returns an error if a setting is out of range, if no Gaussian in the box is visible, or if there are too many cells
/// for memory.
pub fn voxelize(splats: &Splats, settings: &VoxelSettings) -> Result<PlenOctree, SplatError> {
    Voxels::new(splats, settings)?.field(settings.leaves)
}
