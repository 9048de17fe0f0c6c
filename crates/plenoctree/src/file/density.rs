//! What files do to densities, where it shows.

use crate::field::PlenOctree;

/// The largest density of files, a half float.
const MOST: f64 = 65504.0;
/// The smallest one, and the distance between those near it.
const LEAST: f64 = 1.0 / 16_777_216.0;
/// The optical depth beyond which light that is left does not show.
const OPAQUE: f64 = 7.0;
/// The optical depth below which a difference in a cell does not show.
const FAINT: f64 = 0.01;

/// A density that a file changes so much that it shows. Files hold half floats, per unit of length.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DensityLoss {
    /// It is cut off, and cells with what is left let light through.
    #[error(
        "found a density of {density:.3e} in cells of {cell:.1e} units, expected at most {MOST}, which lets light \
         through: scale the field up"
    )]
    CutOff {
        /// The highest density.
        density: f32,
        /// Width of a finest cell, in world units.
        cell: f64,
    },
    /// It is rounded too coarsely.
    #[error(
        "found a density of {density:.3e} in cells of {cell:.1e} units, expected a multiple of {LEAST:.0e}, which is too \
         coarse for them: scale the field down"
    )]
    Rounded {
        /// The lowest density.
        density: f32,
        /// Width of a finest cell, in world units.
        cell: f64,
    },
}

impl PlenOctree {
    /// Returns how files change the densities of the field so much that it shows, to warn of it: in units that are far
    /// too large or too small for the field.
    pub fn density_losses(&self) -> impl Iterator<Item = DensityLoss> {
        let cell = 1.0 / (self.frame().scale.max_element() * f64::from(self.depth()).exp2());
        let densities = || self.densities().iter().copied();
        let (least, most) = (densities().fold(f32::INFINITY, f32::min), densities().fold(0.0, f32::max));
        let is_cut_off = f64::from(most) > MOST && MOST * cell < OPAQUE;
        let is_rounded = f64::from(least) < 1024.0 * LEAST && LEAST * cell > FAINT;
        let cut_off = is_cut_off.then_some(DensityLoss::CutOff { density: most, cell });
        let rounded = is_rounded.then_some(DensityLoss::Rounded { density: least, cell });
        cut_off.into_iter().chain(rounded)
    }
}
