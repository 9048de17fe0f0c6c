//! Finds the parts of a cube that are visible from outside, before it is divided into finest cells.

use glam::{DVec3, UVec3};

use super::{
    blocks::{Block, Lattice},
    parts::{PART, Parts},
    settings::{BLUR, FAINTEST, THINNEST, per_cell},
    sight::look,
};
use crate::{
    cells::{BLOCK, Cells, merged_thickness},
    exponential::exp_minus,
    finest::position_of,
    splat::splats::Splats,
};

/// How visible visible cells and their neighbors are, at least: some rays may pass between those that were followed.
const NEIGHBOR: f32 = 1e-6;

/// How visible each coarse cell is: a part of a block of finest cells.
pub struct Coarse {
    /// Coarse cells per side.
    side: u32,
    /// Mean squares of transmittances; 0 where nothing is visible.
    seen: Vec<f32>,
}

impl Coarse {
    /// Looks at the capture in the cube at `corner` whose finest cells, `depth` levels below it, have this `width`.
    /// Nothing is visible outside the box from `low` to `high`.
    pub fn new(splats: &Splats, corner: DVec3, width: f64, depth: u32, [low, high]: [DVec3; 2]) -> Self {
        // Merging cells of half the size tells how much light passes through gaps.
        let lattice = Lattice::new(splats, corner, 2.0 * width, depth - 1, BLUR, None);
        let size = width * f64::from(1 << PART);
        let thinnest = per_cell(THINNEST, depth - 1);
        let faintest = per_cell(FAINTEST, depth);
        let parts = lattice.blocks(
            0,
            |_| Some(Parts::ALL),
            |code, block| {
                let mut cells = Cells::default();
                for code in code << (3 * (BLOCK - 1))..(code + 1) << (3 * (BLOCK - 1)) {
                    let thickness = thickness(block, position_of(code) % (1 << (BLOCK - 1)), thinnest);
                    let center = corner + size * (position_of(code).as_dvec3() + 0.5);
                    if thickness > 0.0 && center.cmpge(low - size).all() && center.cmple(high + size).all() {
                        cells.push(code, 0, thickness, 0.0, &[]);
                    }
                }
                cells
            },
        );
        let cells = Cells::joined(parts);
        let side = 1u32 << (depth - PART);
        let mut coarse = Self { side, seen: vec![0.0; (side as usize).pow(3)] };
        for (cell, sight) in look(&cells, side).into_iter().enumerate() {
            if sight.most * (1.0 - exp_minus(cells.thickness[cell])) < faintest {
                continue;
            }
            let position = position_of(cells.codes[cell]);
            let (first, last) = (position.saturating_sub(UVec3::ONE), (position + 1).min(UVec3::splat(side - 1)));
            for x in first.x..=last.x {
                for y in first.y..=last.y {
                    let row = [first.z, last.z].map(|z| coarse.index(UVec3::new(x, y, z)));
                    coarse.seen[row[0]..=row[1]].iter_mut().for_each(|seen| *seen = seen.max(NEIGHBOR));
                }
            }
            let own = coarse.index(position);
            coarse.seen[own] = coarse.seen[own].max(sight.mean);
        }
        coarse
    }

    /// Returns the part of the cube in which something is visible.
    pub fn filled(&self) -> f64 {
        self.seen.iter().filter(|seen| **seen > 0.0).count() as f64 / self.seen.len() as f64
    }

    /// Returns how visible the finest cell at a position is, or 0 if it is not.
    pub fn seen(&self, position: UVec3) -> f32 {
        self.seen[self.index(position >> PART)]
    }

    /// Returns the parts of a block of finest cells in which something is visible, or `None` if there are none.
    pub fn parts(&self, block: u64) -> Option<Parts> {
        let low = position_of(block) << (BLOCK - PART);
        Parts::some(|part| self.seen[self.index(low + part)] > 0.0)
    }

    /// Returns the parts of a block of cells that are twice as wide in which something is visible, likewise.
    pub fn wide_parts(&self, block: u64) -> Option<Parts> {
        let low = position_of(block) << (BLOCK - PART);
        let eight = |part| (0..8).map(move |code| 2 * (low + part) + position_of(code));
        Parts::some(|part| eight(part).any(|coarse| self.seen[self.index(coarse)] > 0.0))
    }

    /// Returns these cells, by their codes, as if nothing else were visible.
    pub fn only(&self, codes: &[u64]) -> Self {
        let mut only = Self { side: self.side, seen: vec![0.0; self.seen.len()] };
        for index in codes.iter().map(|code| self.index(position_of(*code))) {
            only.seen[index] = self.seen[index];
        }
        only
    }

    fn index(&self, position: UVec3) -> usize {
        ((position.x * self.side + position.y) * self.side + position.z) as usize
    }
}

/// Returns the thickness of the cell that merges eight cells of a block. Those below `thinnest` are empty.
fn thickness(block: &Block, position: UVec3, thinnest: f32) -> f32 {
    let through = std::array::from_fn(|part| {
        let part = part as u32;
        let thickness = block.cell(2 * position + UVec3::new(part >> 2, part >> 1 & 1, part & 1))[0];
        if thickness < thinnest { 1.0 } else { exp_minus(thickness) }
    });
    merged_thickness(through)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Of a block of wide cells, those parts are wanted in which any finest cells are visible.
        #[test]
        fn wide_parts_hold_what_is_visible(chosen in prop::collection::vec(0usize..16 * 16 * 16, 1..200)) {
            // One block of wide cells.
            let mut seen = vec![0.0; 16 * 16 * 16];
            chosen.iter().for_each(|index| seen[*index] = 1.0);
            let coarse = Coarse { side: 16, seen };
            let parts = coarse.wide_parts(0).unwrap();
            for x in 0..1 << BLOCK {
                for y in 0..1 << BLOCK {
                    // Cells are read in groups of eight, as far as these are visible.
                    let is_read = |z: &u32| {
                        let part = UVec3::new(x, y, *z) >> PART << PART;
                        (0..64).any(|code| coarse.seen(2 * (part + position_of(code))) > 0.0)
                    };
                    let mut read = (0..1 << BLOCK).filter(is_read).map(|z| z as usize);
                    let range = read.next().map(|first| [first, read.next_back().unwrap_or(first)]);
                    prop_assert_eq!(parts.range(x as usize, y as usize), range);
                }
            }
        }
    }
}
