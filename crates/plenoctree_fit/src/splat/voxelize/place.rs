//! The cube of a field around a box of a capture.

use glam::{DVec3, UVec3, Vec3};
use half::f16;
use plenoctree::{Activation, Basis, Frame, PlenOctree, UpAxis};
use rayon::prelude::*;

use super::{
    blocks::Block,
    colors::Directions,
    settings::{THINNEST, VoxelSettings, per_cell},
};
use crate::{
    cells::{BLOCK, Cells},
    finest::{least_density, position_of, tree_of},
    splat::{error::SplatError, harmonics::functions, splats::Splats},
};

/// Highest degree of the field's harmonics.
const MOST_DEGREE: u32 = 2;
/// The field's least and greatest depth.
pub const DEPTHS: [u32; 2] = [6, 10];

/// The cube of a field around a box of a capture.
pub struct Place {
    /// The corners of the box.
    pub low: DVec3,
    pub high: DVec3,
    /// Lowest corner and width of the cube.
    pub corner: DVec3,
    size: f64,
    /// Number of the field's harmonics.
    pub functions: usize,
}

impl Place {
    /// Returns the cube for a capture.
    ///
    /// # Errors
    ///
    /// Returns an error if the depth or the box is out of range, or if there is nothing in the capture.
    pub fn new(splats: &Splats, settings: &VoxelSettings) -> Result<Self, SplatError> {
        if !(DEPTHS[0]..=DEPTHS[1]).contains(&settings.depth) {
            return Err(fault("depth", settings.depth.to_string(), "6 to 10"));
        }
        let Some((low, high)) = settings.bounds.or_else(|| splats.dense_bounds()) else {
            return Err(SplatError::Empty { place: "the file".into() });
        };
        if !(low.is_finite() && high.is_finite() && low.cmplt(high).all()) {
            return Err(fault("bounds", format!("{low} to {high}"), "a lowest and a highest corner"));
        }
        let size = (high - low).max_element();
        let corner = 0.5 * (low + high) - 0.5 * size;
        Ok(Self { low, high, corner, size, functions: functions(splats.degree().min(MOST_DEGREE)) })
    }

    /// Returns the width of the finest cells at a depth.
    pub fn width(&self, depth: u32) -> f64 {
        self.size / f64::from(1u32 << depth)
    }

    /// Returns the cells of a block at a depth that are not empty and whose middles are in the box, or outside by at
    /// most this part of their width, with how visible each is. `seen` returns that of eight cells, given the position
    /// of the lowest one: these are left out if it is 0.
    pub fn cells(&self, depth: u32, outside: f64, code: u64, block: &Block, seen: impl Fn(UVec3) -> f32) -> Cells {
        let width = self.width(depth);
        let limits = [(self.low - self.corner) / width - outside, (self.high - self.corner) / width + outside];
        let thinnest = per_cell(THINNEST, depth);
        let mut cells = Cells::default();
        let mut color = Vec::new();
        let first = code << (3 * BLOCK);
        for eight in (first..first + (1 << (3 * BLOCK))).step_by(8) {
            let seen = seen(position_of(eight));
            if seen == 0.0 {
                continue;
            }
            for code in eight..eight + 8 {
                let position = position_of(code);
                let sums = block.cell(position % (1 << BLOCK));
                let center = position.as_dvec3() + 0.5;
                if sums[0] >= thinnest && center.cmpge(limits[0]).all() && center.cmple(limits[1]).all() {
                    color.clear();
                    color.extend(sums[1..].iter().map(|sum| sum / sums[0]));
                    cells.push(code, 0, sums[0], seen, &color);
                }
            }
        }
        cells
    }

    /// Returns the error that there are no cells.
    pub fn empty(&self) -> SplatError {
        SplatError::Empty { place: format!("the box from {:.3} to {:.3}", self.low, self.high) }
    }

    /// Makes the field whose leaves are these cells, without those that readers of files would drop. `depth` is the
    /// level of the finest.
    ///
    /// # Errors
    ///
    /// Returns an error if the cells do not form a field, or if none is left.
    pub fn field(&self, cells: &Cells, depth: u32) -> Result<PlenOctree, SplatError> {
        let finest = self.width(depth);
        let density =
            |(thickness, level): (&f32, &u8)| (f64::from(*thickness) / (finest * f64::from(1u32 << level))) as f32;
        let densities = cells.thickness.iter().zip(&cells.levels).map(density).collect();
        let directions = Directions::new();
        let coefficients = |color: &[f32]| {
            let color: Vec<Vec3> = color.chunks_exact(3).map(Vec3::from_slice).collect();
            directions.convert(&color).into_iter().map(f16::from_f32)
        };
        let coefficients = cells.colors.par_chunks(3 * self.functions).flat_map_iter(coefficients).collect();
        let frame = Frame::spanning(self.corner, self.corner + self.size);
        let basis = Basis::from_functions(self.functions).unwrap_or(Basis::Sh1);
        let leaves: Vec<_> = cells.codes.iter().copied().zip(cells.levels.iter().copied().map(u32::from)).collect();
        let nodes = tree_of(&leaves, depth);
        let field = PlenOctree::new(frame, basis, Activation::Sigmoid, UpAxis::Z, nodes, densities, coefficients)?;
        let field = field.thinned(least_density(frame));
        if field.leaves() == 0 { Err(self.empty()) } else { Ok(field) }
    }
}

/// Returns the error of a setting.
pub fn fault(setting: &'static str, found: String, expected: &'static str) -> SplatError {
    SplatError::Setting { setting, found, expected }
}

#[cfg(test)]
mod tests {
    use glam::Quat;

    use super::*;
    use crate::splat::splats::Gaussian;

    /// What readers of files would drop is not in the field, and a field of nothing else is an error.
    #[test]
    fn leaves_are_those_that_files_keep() {
        let bounds = Some((DVec3::splat(-500.0), DVec3::splat(500.0)));
        let mut splats = Splats::new(0);
        let (position, scale) = (Vec3::ZERO, Vec3::ONE);
        let gaussian = Gaussian { position, scale, rotation: Quat::IDENTITY, opacity: 0.5 };
        splats.push(gaussian, &[Vec3::ZERO]);
        let place = Place::new(&splats, &VoxelSettings { depth: 6, bounds, ..Default::default() }).unwrap();
        let field = |thicknesses: &[f32]| {
            let mut cells = Cells::default();
            thicknesses.iter().zip(0..).for_each(|(thickness, code)| cells.push(code, 0, *thickness, 1.0, &[0.5; 3]));
            place.field(&cells, 6)
        };
        assert_eq!(field(&[1e-3, 3e-2, 1.0]).unwrap().leaves(), 2);
        assert!(matches!(field(&[1e-3]), Err(SplatError::Empty { .. })));
    }
}
