//! Converts a capture to a field: spreads the optical depth of every Gaussian over the cells that it covers, and
//! averages colors weighted by it.

mod blocks;
mod colors;
mod gaussian;
mod optics;

use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;
use half::f16;
use plenoctree::{Activation, Basis, Frame, PlenOctree, UpAxis};
use rayon::prelude::*;

use self::{
    blocks::{Region, regions},
    gaussian::CellGaussian,
    optics::Profile,
};
use super::{error::SplatError, harmonics::functions, splats::Splats};
use crate::finest::tree_of_finest;

/// Highest degree of the field's harmonics.
const MOST_DEGREE: u32 = 2;
/// Maximum number of leaves of a field: 2 GB of coefficients of degree 2.
const MOST_LEAVES: usize = 40_000_000;

/// Settings of [`voxelize`].
#[derive(Clone, Debug, PartialEq)]
pub struct VoxelSettings {
    /// Number of levels of cells, 6 to 10: the field has `2^depth` cells per side. 8 by default.
    pub depth: u32,
    /// Lowest and highest corner of the box to convert. By default, it is [`Splats::dense_bounds`]. The field's cube is
    /// around it.
    pub bounds: Option<(DVec3, DVec3)>,
}

impl Default for VoxelSettings {
    fn default() -> Self {
        Self { depth: 8, bounds: None }
    }
}

/// Converts a capture to a field, in the capture's coordinates, on all cores of the current rayon pool. The field is
/// the same on any number of threads.
///
/// The field looks about like the capture. Its colors use [`Activation::Sigmoid`], the default for files that record
/// none, with harmonics up to degree 2.
///
/// # Errors
///
/// Returns an error if a setting is out of range, if no Gaussian in the box is visible, or if there are too many cells
/// for memory.
pub fn voxelize(splats: &Splats, settings: &VoxelSettings) -> Result<PlenOctree, SplatError> {
    let fault = |setting, found, expected| Err(SplatError::Setting { setting, found, expected });
    if !(6..=10).contains(&settings.depth) {
        return fault("depth", settings.depth.to_string(), "6 to 10");
    }
    let Some((low, high)) = settings.bounds.or_else(|| splats.dense_bounds()) else {
        return Err(SplatError::Empty { place: "the file".into() });
    };
    if !(low.is_finite() && high.is_finite() && low.cmplt(high).all()) {
        return fault("bounds", format!("{low} to {high}"), "a lowest and a highest corner");
    }
    let size = (high - low).max_element();
    let corner = 0.5 * (low + high) - 0.5 * size;
    let cells = 1u32 << settings.depth;
    let width = size / f64::from(cells);
    let profile = Profile::new();
    let limits = [(low - corner) / width, (high - corner) / width];
    let gaussians: Vec<CellGaussian> = (splats.gaussians().par_iter().enumerate())
        .filter_map(|(index, gaussian)| CellGaussian::new(gaussian, index as u32, corner, width, cells))
        .collect();
    let degree = splats.degree().min(MOST_DEGREE);
    let leaves = AtomicUsize::new(0);
    let parts: Vec<Region> = regions(settings.depth)
        .into_par_iter()
        .map(|region| {
            if leaves.load(Ordering::Relaxed) > MOST_LEAVES {
                return region;
            }
            let region = region.filled(splats, &gaussians, degree, &profile, limits);
            leaves.fetch_add(region.codes.len(), Ordering::Relaxed);
            region
        })
        .collect();
    let count = leaves.into_inner();
    if count > MOST_LEAVES {
        return fault(
            "depth",
            format!("{} with more than {MOST_LEAVES} cells", settings.depth),
            "a lower depth or a smaller box",
        );
    }
    if count == 0 {
        return Err(SplatError::Empty { place: format!("the box from {low:.3} to {high:.3}") });
    }
    let mut codes = Vec::with_capacity(count);
    let mut densities = Vec::with_capacity(count);
    let mut coefficients: Vec<f16> = Vec::with_capacity(count * 3 * functions(degree));
    for part in parts {
        codes.extend(part.codes);
        densities.extend(part.thickness.iter().map(|thickness| (f64::from(*thickness) / width) as f32));
        coefficients.extend(part.coefficients);
    }
    let frame = Frame::spanning(corner, corner + size);
    let basis = Basis::from_functions(functions(degree)).unwrap_or(Basis::Sh1);
    let nodes = tree_of_finest(&codes, settings.depth);
    Ok(PlenOctree::new(frame, basis, Activation::Sigmoid, UpAxis::Z, nodes, densities, coefficients)?)
}
