//! Chooses the cells of a capture: among cells twice as wide as the finest ones, and where those are not merged, among
//! the finest.

use std::sync::atomic::{AtomicUsize, Ordering};

use super::{
    blocks::{Block, Lattice},
    coarse::Coarse,
    gaussian::Shown,
    parts::PART,
    place::Place,
};
use crate::{
    cells::{Cells, Tree, price},
    splat::splats::Splats,
};

/// Of this many blocks, one is used to estimate the price of a cell.
const SAMPLED: u64 = 13;
/// Wide cells are divided if that is worth this part of a cell's price, as finest cells show details that wide ones
/// blur.
const DIVIDED: f32 = 0.25;
/// The largest number of cells in memory.
pub const MOST_CELLS: usize = 40_000_000;

/// The cells of a capture, of which those are chosen that pictures need.
pub struct Choice<'a> {
    pub place: &'a Place,
    /// Levels of the finest cells.
    pub depth: u32,
    /// What is visible in them.
    pub seen: Coarse,
    /// The levels that chosen cells may have: the first and the last one.
    pub levels: [u8; 2],
    /// The Gaussians among the finest cells.
    pub finest: Lattice<'a>,
    /// The same Gaussians among cells that are twice as wide, with the same optical depths in all.
    pub wide: Lattice<'a>,
}

/// Returns the Gaussians among the finest cells, at this depth, and among cells that are twice as wide. `blur` and
/// `shown` are those of the finest cells.
pub fn lattices<'a>(splats: &'a Splats, place: &Place, depth: u32, blur: f64, shown: &[Shown]) -> [Lattice<'a>; 2] {
    let lattice =
        |depth, blur, shown: &[Shown]| Lattice::new(splats, place.corner, place.width(depth), depth, blur, Some(shown));
    // As much as merging finest cells blurs, whose middles have a variance of a quarter of the square of their width.
    let wide_blur = 0.5 * (blur * blur + 0.25).sqrt();
    let wide_shown: Vec<Shown> = shown.iter().map(|shown| Shown { area: 0.25 * shown.area, ..*shown }).collect();
    [lattice(depth, blur, shown), lattice(depth - 1, wide_blur, &wide_shown)]
}

impl Choice<'_> {
    /// Returns the price of a cell at which about this number is chosen, judging by a sample of the blocks, but not
    /// less than `least`.
    pub fn price(&self, goal: usize, least: f32) -> f32 {
        let wanted = |code: u64| if code.is_multiple_of(SAMPLED) { self.seen.parts(code) } else { None };
        let tree = |code, block: &Block| {
            let cells = self.place.cells(self.depth, 0.0, code, block, |position| self.seen.seen(position));
            Tree::new(&cells, least, self.levels)
        };
        price(&self.finest.blocks(self.place.functions, wanted, tree), goal / SAMPLED as usize).max(least)
    }

    /// Chooses the cells that are worth this price, and more of the wide ones, or returns `None` if they are too many
    /// for memory.
    ///
    /// Of the finest cells, hardly any are chosen, so they are only made in those parts of which the wide cells are not
    /// merged.
    pub fn cells(self, price: f32) -> Option<Cells> {
        let Self { place, depth, seen, levels, finest, wide } = self;
        let count = AtomicUsize::new(0);
        let fits = || count.load(Ordering::Relaxed) <= MOST_CELLS;
        let chosen = |cells: &Cells, price: f32, levels| {
            let tree = Tree::new(cells, price, levels);
            tree.cells(&tree.cut(price))
        };
        let counted = |cells: &Cells| count.fetch_add(cells.len(), Ordering::Relaxed);

        let kept_and_divided = |code, block: &Block| {
            // Also those of which only the inner half is in the box.
            let cells = place.cells(depth - 1, 0.25, code, block, |position| seen.seen(2 * position));
            // Errors are in faces of wide cells, which are four times as large.
            let cells = chosen(&cells, DIVIDED * 0.25 * price, [levels[0].saturating_sub(1), levels[1] - 1]);
            let (mut kept, mut divided) = (Cells::default(), Vec::new());
            for cell in 0..cells.len() {
                let part = cells.codes[cell] >> (3 * (PART - 1));
                if cells.levels[cell] > 0 {
                    kept.push_from(&cells, cell);
                } else if divided.last() != Some(&part) {
                    divided.push(part);
                }
            }
            counted(&kept);
            kept.codes.iter_mut().for_each(|code| *code <<= 3);
            kept.levels.iter_mut().for_each(|level| *level += 1);
            (kept, divided)
        };
        let wanted = |code| seen.wide_parts(code).filter(|_| fits());
        let (mut lists, divided): (Vec<_>, Vec<_>) =
            wide.blocks(place.functions, wanted, kept_and_divided).into_iter().unzip();
        drop(wide);

        let divided = seen.only(&divided.concat());
        let of_divided = |code, block: &Block| {
            let cells = place.cells(depth, 0.0, code, block, |position| divided.seen(position));
            // They are not merged with what was kept around them.
            let cells = chosen(&cells, price, [levels[0], PART as u8]);
            counted(&cells);
            cells
        };
        let wanted = |code| divided.parts(code).filter(|_| fits());
        lists.extend(finest.blocks(place.functions, wanted, of_divided));
        fits().then(|| Cells::joined(lists))
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Quat, UVec3, Vec3};

    use super::*;
    use crate::{
        cells::BLOCK,
        exponential::exp_minus,
        finest::position_of,
        splat::{
            splats::Gaussian,
            voxelize::{
                areas::areas,
                parts::Parts,
                settings::{BLUR, VoxelSettings},
            },
        },
    };

    const DEPTH: u32 = 7;

    /// Returns a board of thin Gaussians, with narrow stripes on one half.
    fn board() -> Splats {
        let mut splats = Splats::new(0);
        for index in 0..90 * 90 {
            let [x, y] = [index % 90, index / 90];
            let position = Vec3::new((x as f32 + 0.5) / 90.0, (y as f32 + 0.5) / 90.0, 0.513);
            let light = if x >= 45 && y % 2 == 0 { 1.5 } else { 0.0 };
            let scale = Vec3::new(0.005, 0.005, 0.001);
            let gaussian = Gaussian { position, scale, rotation: Quat::IDENTITY, opacity: 0.95 };
            splats.push(gaussian, &[Vec3::splat(light)]);
        }
        splats
    }

    /// Gaussians have the same optical depths in all in wide cells, also those whose opacity falls as they are blurred.
    #[test]
    fn wide_cells_hold_as_much_as_finest_cells() {
        let settings = VoxelSettings { bounds: Some((DVec3::ZERO, DVec3::ONE)), ..Default::default() };
        for (antialiased, scale) in [(false, 0.1), (true, 0.1), (false, 1.0), (true, 1.0)] {
            let mut splats = Splats::new(0);
            splats.set_antialiased(antialiased);
            let cell = 1.0 / (1 << DEPTH) as f32;
            for index in 0..400 {
                let position = Vec3::new(0.618, 0.755, 0.570) * index as f32;
                let position = 0.1 + 0.8 * (position - position.floor());
                let scale = cell * Vec3::new(scale, scale, 0.1 * scale);
                let gaussian = Gaussian { position, scale, rotation: Quat::IDENTITY, opacity: 0.9 };
                splats.push(gaussian, &[Vec3::ONE]);
            }
            let place = Place::new(&splats, &settings).unwrap();
            let shown = areas(&splats, &[], place.width(DEPTH), BLUR);
            let sums = lattices(&splats, &place, DEPTH, BLUR, &shown).map(|lattice| {
                let sum = |_, block: &Block| {
                    let side = 1 << BLOCK;
                    let cell =
                        |index: u32| block.cell(UVec3::new(index / side / side, index / side % side, index % side))[0];
                    (0..side.pow(3)).map(cell).sum::<f32>()
                };
                lattice.blocks(0, |_| Some(Parts::ALL), sum).into_iter().sum::<f32>()
            });
            let ratio = 4.0 * sums[1] / sums[0];
            // Sums at the middles of cells are not integrals.
            assert!((0.9..1.1).contains(&ratio), "{antialiased} {scale}: {ratio}");
        }
    }

    /// Cells are those that are chosen among all finest cells, nearly: they let about as much light through, and are as
    /// small where there are stripes. They do not overlap.
    #[test]
    fn finest_cells_are_made_where_they_are_chosen() {
        let splats = board();
        let settings = VoxelSettings { bounds: Some((DVec3::ZERO, DVec3::ONE)), ..Default::default() };
        let place = Place::new(&splats, &settings).unwrap();
        let shown = areas(&splats, &[], place.width(DEPTH), BLUR);
        let [finest, wide] = lattices(&splats, &place, DEPTH, BLUR, &shown);
        let seen = Coarse::new(&splats, place.corner, place.width(DEPTH), DEPTH, [place.low, place.high]);
        let (price, levels) = (0.02, [0, BLOCK as u8]);
        let tree = |code, block: &Block| {
            let cells = place.cells(DEPTH, 0.0, code, block, |position| seen.seen(position));
            let tree = Tree::new(&cells, price, levels);
            tree.cells(&tree.cut(price))
        };
        let expected = Cells::joined(finest.blocks(place.functions, |code| seen.parts(code), tree));
        let choice = Choice { place: &place, depth: DEPTH, seen, levels, finest, wide };
        let found = Cells::joined(choice.cells(price).unwrap().blocks(|_| true));
        let mut end = 0;
        for (code, level) in found.codes.iter().zip(&found.levels) {
            assert!(*code >= end);
            end = code + (1 << (3 * level));
        }
        // Mean optical depths of columns of four by four finest cells.
        let depths = |cells: &Cells| {
            let mut depths = vec![0.0; 32 * 32];
            for (cell, thickness) in cells.thickness.iter().enumerate() {
                let (at, size) = (position_of(cells.codes[cell]) / 4, 1u32 << cells.levels[cell]);
                let columns = (size / 4).max(1);
                for column in 0..columns * columns {
                    let index = (at.x + column / columns) * 32 + at.y + column % columns;
                    depths[index as usize] += thickness * (size.min(4).pow(2)) as f32 / 16.0;
                }
            }
            depths
        };
        for (found, expected) in depths(&found).into_iter().zip(depths(&expected)) {
            assert!((exp_minus(found) - exp_minus(expected)).abs() < 0.02, "{found} {expected}");
        }
        let finest = |cells: &Cells| {
            let is_finest = |cell: &usize| cells.levels[*cell] == 0;
            let halves = |cell: usize| position_of(cells.codes[cell]).x / 64;
            (0..cells.len()).filter(is_finest).map(halves).fold([0.0, 0.0], |mut counts, half| {
                counts[half as usize] += 1.0;
                counts
            })
        };
        let ([plain, striped], [_, all]) = (finest(&found), finest(&expected));
        assert!(plain < 0.02 * striped && striped > 0.98 * all, "{plain} {striped} {all}");
    }
}
