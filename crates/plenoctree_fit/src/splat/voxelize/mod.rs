//! Converts a capture to a field: adds up the optical depth of its Gaussians in small cells, and merges cells where that
//! does not show.

mod blocks;
mod cells;
mod coarse;
mod colors;
mod gaussian;
mod optics;
mod place;
mod sight;
mod tree;
mod uniform;
mod voxels;

use glam::DVec3;
use plenoctree::PlenOctree;

pub use self::voxels::Voxels;
use super::{error::SplatError, splats::Splats};

/// The blur of each Gaussian, as a standard deviation in finest cells: narrower ones would fall between the centers of
/// cells.
const BLUR: f64 = 0.4;
/// Thickness below which a cell is empty, if Gaussians are added up in cells of the size of finest leaves.
const THINNEST: f32 = 2e-3;

/// Settings of [`voxelize`].
#[derive(Clone, Debug, PartialEq)]
pub struct VoxelSettings {
    /// Number of levels of cells, 6 to 10: the finest are `2^-depth` of the field's cube wide. 8 by default.
    ///
    /// Captures look different from different distances: their Gaussians are never narrower than a pixel. The field looks
    /// like the capture where a finest cell is about as wide as a pixel, so a greater depth is for views from nearer.
    pub depth: u32,
    /// The largest number of leaves of any size, 32768 to 20,000,000: they are small where the capture shows detail, and
    /// what is hidden from outside is left out. By default, `None`, all cells that are not empty become finest leaves, as
    /// [refining](crate::refine()) needs them.
    pub leaves: Option<usize>,
    /// Lowest and highest corner of the box to convert. By default, it is [`Splats::dense_bounds`]. The field's cube is
    /// around it.
    pub bounds: Option<(DVec3, DVec3)>,
}

impl Default for VoxelSettings {
    /// Finest leaves at depth 8.
    fn default() -> Self {
        Self { depth: 8, leaves: None, bounds: None }
    }
}

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
    match settings.leaves {
        Some(leaves) => Voxels::new(splats, settings)?.field(leaves),
        None => uniform::field(splats, settings),
    }
}
