//! The finest cells of a field, for samplers on the GPU.

use glam::UVec3;

use super::progress::{Canceled, Progress};
use crate::field::{Cell, PlenOctree};

/// The largest number of finest cells that are listed: 256 MiB.
const MOST_CELLS: u64 = 1 << 26;

/// The finest cells in the box around all leaves, a word each, so that every step of a ray loads one word.
///
/// The low [four bits](Self::SIZE_BITS) of a word are the base-2 logarithm of the width of the octree's cell around it,
/// in finest cells, at most 15. That cell may extend beyond the box. The other bits are those of its density, rounded to a float
/// without the low four bits, and 0 if the cell is empty.
#[derive(Clone, Debug, PartialEq)]
pub struct Lattice {
    /// The lowest corner of the box, in finest cells.
    pub low: UVec3,
    /// The number of finest cells along each axis.
    pub size: UVec3,
    /// The words, with z varying fastest.
    pub words: Vec<u32>,
}

impl Lattice {
    /// The bits of a word that hold the size of its cell.
    pub const SIZE_BITS: u32 = 15;

    /// Lists the finest cells of a field, counted in a tree of `depth` levels, which must be no less than the field's.
    /// Returns `None` if there are no leaves, or too many cells.
    ///
    /// # Errors
    ///
    /// Returns an error if [`Progress::cancel`] is called.
    pub fn new(field: &PlenOctree, depth: u32, progress: &Progress) -> Result<Option<Self>, Canceled> {
        let Some((low, high)) = field.cell_bounds() else { return Ok(None) };
        let finer = depth - field.depth();
        let (low, size) = (low << finer, (high - low) << finer);
        let cells: u64 = size.to_array().into_iter().map(u64::from).product();
        if cells > MOST_CELLS {
            return Ok(None);
        }
        let mut lattice = Self { low, size, words: vec![0; cells as usize] };
        field.visit_cells(0, UVec3::ZERO, 1 << depth, &mut |cell, corner, width| {
            if !progress.is_canceled() {
                lattice.set(corner, width, word(field, cell, width));
            }
        });
        progress.check()?;
        Ok(Some(lattice))
    }

    /// Writes a cube of cells, as far as it is in the box.
    fn set(&mut self, corner: UVec3, width: u32, word: u32) {
        let from = corner.clamp(self.low, self.low + self.size) - self.low;
        let to = (corner + width).clamp(self.low, self.low + self.size) - self.low;
        for (x, y) in (from.x..to.x).flat_map(|x| (from.y..to.y).map(move |y| (x, y))) {
            let row = self.index(UVec3::new(x, y, 0));
            self.words[row + from.z as usize..row + to.z as usize].fill(word);
        }
    }

    /// Returns the index of a cell of the box in [`Self::words`].
    pub fn index(&self, cell: UVec3) -> usize {
        let [x, y, z] = cell.to_array().map(|at| at as usize);
        (x * self.size.y as usize + y) * self.size.z as usize + z
    }
}

fn word(field: &PlenOctree, cell: Cell, width: u32) -> u32 {
    let size = width.ilog2().min(Lattice::SIZE_BITS);
    let density = cell.as_leaf().map_or(0.0, |leaf| field.densities()[leaf as usize]);
    let half = Lattice::SIZE_BITS / 2 + 1;
    // The largest floats must not become infinite.
    let rounded = (density.to_bits() + half).min(f32::MAX.to_bits());
    rounded & !Lattice::SIZE_BITS | size
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::{
        bake::{BakeSettings, bake},
        field::Basis,
    };

    /// Every cell in the box has the density and the size of the octree's cell around it, also in finer cells.
    #[test]
    fn words_are_the_cells_of_the_octree() {
        let settings = BakeSettings { depth: 5, basis: Basis::Sh1, ..Default::default() };
        let inside = |at: DVec3| if at.x < 0.1 && at.length() < 0.9 { 5.0 + at.z } else { 0.0 };
        let field = bake(&settings, inside, |_| |_| DVec3::ONE).unwrap();
        let mut sizes = 0;
        for finer in 0..2 {
            let lattice = Lattice::new(&field, field.depth() + finer, &Progress::default()).unwrap().unwrap();
            for (x, y, z) in (0..lattice.size.x)
                .flat_map(|x| (0..lattice.size.y).flat_map(move |y| (0..lattice.size.z).map(move |z| (x, y, z))))
            {
                let at = UVec3::new(x, y, z);
                let word = lattice.words[lattice.index(at)];
                let (cell, _, size) = field.locate((lattice.low + at) >> finer);
                let expected = cell.as_leaf().map_or(0.0, |leaf| field.densities()[leaf as usize]);
                let density = f32::from_bits(word & !Lattice::SIZE_BITS);
                assert!((density - expected).abs() <= 1e-6 * expected, "{density}, expected {expected}");
                assert_eq!(1 << (word & Lattice::SIZE_BITS), size << finer);
                sizes |= size;
            }
        }
        assert!(sizes.count_ones() > 1, "all cells have the same size");
    }

    #[test]
    fn large_boxes_have_no_lattice() {
        let settings = BakeSettings { depth: 2, basis: Basis::Sh1, ..Default::default() };
        let field = bake(&settings, |_| 1.0, |_| |_| DVec3::ONE).unwrap();
        let cells = |depth| Lattice::new(&field, depth, &Progress::default()).unwrap().map(|found| found.words.len());
        assert_eq!([cells(2), cells(9)], [Some(64), None]);
    }
}
