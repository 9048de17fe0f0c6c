//! Settings of conversion.

use glam::DVec3;
use plenoctree::camera::PinholeCamera;

/// The blur of each Gaussian, as a standard deviation in finest cells, unless the settings say otherwise: narrower ones
/// would fall between the centers of cells.
pub(super) const BLUR: f64 = 0.4;
/// The least and the greatest blur.
pub(super) const BLURS: [f64; 2] = [0.1, 0.5];
/// Thickness below which a cell is empty, if it is not deeper than eight levels. Rays through haze cross hundreds.
pub(super) const THINNEST: f32 = 2e-4;
/// Opacity that such a cell must add to some ray.
pub(super) const FAINTEST: f32 = 1e-3;

/// Returns what is left of a limit for single cells at a depth: rays pass more cells that are smaller, so that what is
/// left out would add up.
pub(super) fn per_cell(limit: f32, depth: u32) -> f32 {
    limit * (8.0 - depth as f32).min(0.0).exp2()
}

/// Settings of [`voxelize`](super::voxelize()).
#[derive(Clone, Debug, PartialEq)]
pub struct VoxelSettings {
    /// Number of levels of cells, 6 to 10: the finest are `2^-depth` of the field's cube wide. 8 by default.
    ///
    /// Captures look different from different distances: their Gaussians are never narrower than a pixel. The field
    /// looks like the capture where a finest cell is about as wide as a pixel, so a greater depth is for views from
    /// nearer.
    pub depth: u32,
    /// The largest number of leaves of any size, 32768 to 20,000,000. 3,000,000 by default. They are small where the
    /// capture shows detail, and what is hidden from outside is left out.
    pub leaves: usize,
    /// Lowest and highest corner of the box to convert. By default, it is
    /// [`Splats::dense_bounds`](crate::splat::Splats::dense_bounds). The field's cube is around it.
    pub bounds: Option<(DVec3, DVec3)>,
    /// The standard deviation by which each Gaussian is blurred, in finest cells, 0.1 to 0.5. 0.4 by default. Less is
    /// for views in which a finest cell is about as wide as a pixel, or wider: they are sharper.
    pub blur: f64,
    /// Cameras from where the field must look right, such as a hundred all around with small pictures. Each Gaussian
    /// then gets the density with which it has its opacity for those that see it. By default, there are none: it has
    /// its opacity in the mean of all directions.
    pub views: Vec<PinholeCamera>,
}

impl Default for VoxelSettings {
    fn default() -> Self {
        Self { depth: 8, leaves: 3_000_000, bounds: None, blur: BLUR, views: Vec::new() }
    }
}
