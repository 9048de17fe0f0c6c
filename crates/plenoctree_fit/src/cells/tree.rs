//! Trees of a block of cells: what each cell would lose if it were not split, and which splits are worth their leaves.

use std::f32::consts::PI;

use rayon::prelude::*;

use super::list::{BLOCK, Cells};
use crate::exponential::exp_minus;

/// Square of the difference, per channel, between a cell and what is seen behind it: what an error of opacity costs.
const CONTRAST: f32 = 0.06;
/// The largest number of harmonics.
const MOST_FUNCTIONS: usize = 16;
/// Thickness from which on a cell is opaque: hardly any light gets through.
const OPAQUE: f32 = 40.0;
/// Binary logarithms of the lowest and the highest price to try, and how often to halve the range.
const PRICES: [f32; 2] = [-40.0, 24.0];
const PRICE_STEPS: usize = 14;

/// A tree over the cells of a block: the cells, and larger ones that could stand for them.
pub struct Tree {
    /// The price per cell from which on its cuts are those of the whole tree. For lower ones, they have fewer cells.
    price: f32,
    /// The levels that cells of a cut may have: the first and the last one.
    levels: [u8; 2],
    /// The cells that a cut may have, each after those that it is made of.
    cells: Cells,
    /// The index of the first cell of each cell's subtree.
    starts: Vec<u32>,
    /// What a cell adds to the squared error of pictures if it stands for its subtree: its area in finest cells, times
    /// how visible it is, times the error.
    errors: Vec<f32>,
}

/// A choice of cells of a [`Tree`] that do not overlap.
pub struct Cut {
    count: usize,
    /// Whether each cell of the tree stands for its subtree.
    stands: Vec<bool>,
}

impl Cut {
    /// Returns the number of cells.
    pub fn count(&self) -> usize {
        self.count
    }
}

impl Tree {
    /// Builds the tree of cells that are all in one block, in the order of their codes, without those that no cut has
    /// for at least this `price` per cell, or that do not have these `levels`.
    pub fn new(cells: &Cells, price: f32, levels: [u8; 2]) -> Self {
        let mut tree = Self { price, levels, cells: Cells::default(), starts: Vec::new(), errors: Vec::new() };
        if let Some(first) = cells.codes.first() {
            let block = first >> (3 * BLOCK) << (3 * BLOCK);
            tree.append(cells, &mut 0, block, BLOCK as u8);
        }
        tree
    }

    /// Appends a cell and all below it. Returns its index, and the smallest sum of errors and of prices of it or of
    /// cells that it is made of, or `None` if it is empty.
    fn append(&mut self, cells: &Cells, next: &mut usize, code: u64, level: u8) -> Option<(u32, f32)> {
        let first = *cells.codes.get(*next)?;
        if first >= code + (1 << (3 * level)) {
            return None;
        }
        let start = self.starts.len() as u32;
        if cells.levels[*next] == level {
            self.cells.push_from(cells, *next);
            self.starts.push(start);
            self.errors.push(0.0);
            *next += 1;
            return Some((start, self.price));
        }
        let parts: [_; 8] = std::array::from_fn(|octant| {
            let code = code + ((octant as u64) << (3 * (level - 1)));
            self.append(cells, next, code, level - 1)
        });
        // In the order of `cut`, so that both agree to the last bit.
        let mut cost = parts.iter().rev().flatten().map(|(_, cost)| cost).sum();
        let parts = parts.map(|part| Some(part?.0));
        let below: f32 = parts.iter().flatten().map(|part| self.errors[*part as usize]).sum();
        let merged = Merged::new(&self.cells, parts);
        let area = (1u64 << (2 * level)) as f32;
        let error = below + area * merged.seen * merged.lost;
        if self.stands(level, self.price + error, cost) {
            // It also does so for any higher price.
            self.cells.truncate(start as usize);
            self.starts.truncate(start as usize);
            self.errors.truncate(start as usize);
            cost = self.price + error;
        }
        self.cells.push(code, level, merged.thickness, merged.seen, &merged.color[..cells.stride()]);
        self.starts.push(start);
        self.errors.push(error);
        Some((self.starts.len() as u32 - 1, cost))
    }

    /// Returns whether a cell stands for its parts, by the sum of errors and prices of both.
    fn stands(&self, level: u8, whole: f32, parts: f32) -> bool {
        level <= self.levels[0] || whole <= parts && level <= self.levels[1]
    }

    /// Chooses the cells that have the smallest sum of errors and of `price` per cell.
    pub fn cut(&self, price: f32) -> Cut {
        let mut stands = vec![false; self.starts.len()];
        // The costs and counts of the subtrees that are not part of another one yet.
        let mut open: Vec<(u32, f32, usize)> = Vec::new();
        for (cell, &start) in self.starts.iter().enumerate() {
            let (mut cost, mut count) = (0.0, 0);
            while let Some(&(_, own, parts)) = open.last().filter(|(part, ..)| *part >= start) {
                (cost, count) = (cost + own, count + parts);
                open.pop();
            }
            let whole = price + self.errors[cell];
            if count == 0 || self.stands(self.cells.levels[cell], whole, cost) {
                (cost, count) = (whole, 1);
                stands[cell] = true;
            }
            open.push((start, cost, count));
        }
        Cut { count: open.iter().map(|(.., count)| count).sum(), stands }
    }

    /// Returns the cells of a cut.
    pub fn cells(&self, cut: &Cut) -> Cells {
        let mut chosen = Vec::with_capacity(cut.count);
        let mut end = self.starts.len();
        while end > 0 {
            let cell = end - 1;
            if cut.stands[cell] {
                chosen.push(cell);
                end = self.starts[cell] as usize;
            } else {
                end = cell;
            }
        }
        let mut cells = Cells::default();
        for cell in chosen.into_iter().rev() {
            cells.push_from(&self.cells, cell);
        }
        cells
    }
}

/// Returns the lowest price of a cell with which trees have at most `goal` cells. Prices are powers of two.
pub fn price(trees: &[Tree], goal: usize) -> f32 {
    let count = |price: f32| trees.par_iter().map(|tree| tree.cut(price).count()).sum::<usize>();
    let [mut low, mut high] = PRICES;
    for _ in 0..PRICE_STEPS {
        let middle = 0.5 * (low + high);
        if count(middle.exp2()) > goal { low = middle } else { high = middle }
    }
    high.exp2()
}

/// The coefficients of a cell.
type Color = [f32; 3 * MOST_FUNCTIONS];

/// A cell that stands for eight cells.
struct Merged {
    thickness: f32,
    seen: f32,
    color: Color,
    /// The squared error of a picture that this cell fills, summed over its channels.
    lost: f32,
}

impl Merged {
    fn new(cells: &Cells, parts: [Option<u32>; 8]) -> Self {
        let of = |values: &[f32]| parts.map(|part| part.map_or(0.0, |part| values[part as usize]));
        let seen = of(&cells.seen);
        let through = of(&cells.thickness).map(exp_minus);
        // Half of the cells of a flat surface are in front, and all cells of haze are seen.
        let most = seen.iter().copied().fold(0.0, f32::max);
        // What is hidden does not show, so it hardly matters.
        let weights: [f32; 8] = std::array::from_fn(|part| {
            let weight = ((1.0 - through[part]) * (seen[part] + 1e-3 * most)).max(f32::MIN_POSITIVE);
            if parts[part].is_some() { weight } else { 0.0 }
        });
        let total = weights.iter().sum::<f32>();
        let stride = cells.stride();
        let mut color = [0.0; 3 * MOST_FUNCTIONS];
        let mut differences = Differences::default();
        for (channel, mean) in color[..stride].iter_mut().enumerate() {
            let values = parts.map(|part| part.map_or(0.0, |part| cells.colors[part as usize * stride + channel]));
            *mean = values.iter().zip(&weights).map(|(value, weight)| weight * value).sum::<f32>() / total;
            let off = |part: usize| if parts[part].is_some() { values[part] - *mean } else { 0.0 };
            differences.add(std::array::from_fn(off));
        }
        let thickness = merged_thickness(through);
        let lost = differences.lost(through, thickness);
        Self { thickness, seen: most.min(0.25 * seen.iter().sum::<f32>()), color, lost }
    }
}

/// The parts of a cell that are in front along each axis, and those behind them.
const FRONT: [[usize; 4]; 3] = [[0, 1, 2, 3], [0, 1, 4, 5], [0, 2, 4, 6]];
const BEHIND: [[usize; 4]; 3] = [[4, 5, 6, 7], [2, 3, 6, 7], [1, 3, 5, 7]];

/// Sums over the channels of what the coefficients of parts differ from those of the whole.
#[derive(Default)]
struct Differences {
    squares: [f32; 8],
    /// The products of parts behind each other.
    products: [[f32; 4]; 3],
}

impl Differences {
    /// Adds those of a channel.
    fn add(&mut self, channel: [f32; 8]) {
        (0..8).for_each(|part| self.squares[part] += channel[part] * channel[part]);
        for ((sums, front), behind) in self.products.iter_mut().zip(&FRONT).zip(&BEHIND) {
            (0..4).for_each(|pair| sums[pair] += channel[front[pair]] * channel[behind[pair]]);
        }
    }

    /// Returns the squared error of the pictures that a cell of this `thickness` fills, in place of its parts, along
    /// each axis from either side. `through` is the transmittance of each.
    fn lost(&self, through: [f32; 8], thickness: f32) -> f32 {
        let whole = 1.0 - exp_minus(thickness);
        let mut sums = [0.0; 4];
        for ((products, front), behind) in self.products.iter().zip(&FRONT).zip(&BEHIND) {
            for pair in 0..4 {
                let [near, far] = [front[pair], behind[pair]];
                let difference = 1.0 - through[near] * through[far] - whole;
                sums[pair] += 2.0 * 3.0 * CONTRAST * difference * difference;
                for [front, behind] in [[near, far], [far, near]] {
                    let (a, b) = (1.0 - through[front], through[front] * (1.0 - through[behind]));
                    // The mean of the square over all directions.
                    let square = a * a * self.squares[front] + b * b * self.squares[behind];
                    sums[pair] += (square + 2.0 * a * b * products[pair]) / (4.0 * PI);
                }
            }
        }
        sums.iter().sum::<f32>() / 24.0
    }
}

/// Returns the thickness of the cell that lets as much light through as eight cells, averaged over rays along the three
/// axes. `through` is the transmittance of each.
pub fn merged_thickness(through: [f32; 8]) -> f32 {
    let along = |bit: usize| {
        let columns = (0..8).filter(|cell| cell & bit == 0);
        let mean = columns.map(|cell| through[cell] * through[cell | bit]).sum::<f32>() / 4.0;
        -mean.max((-OPAQUE).exp()).ln()
    };
    (along(4) + along(2) + along(1)) / 3.0
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const LEVELS: [u8; 2] = [0, BLOCK as u8];

    /// A cube of 8 x 8 x 8 finest cells.
    fn cube(thickness: impl Fn(u64) -> f32, light: impl Fn(u64) -> f32) -> Cells {
        let mut cells = Cells::default();
        (0..512).for_each(|code| cells.push(code, 0, thickness(code), 0.5, &[light(code); 3]));
        cells
    }

    /// Cells that agree become one, which lets as much light through.
    #[test]
    fn equal_cells_are_merged() {
        for thickness in [1e-3, 0.1, 3.0] {
            let tree = Tree::new(&cube(|_| thickness, |_| 0.7), 0.0, [0, 3]);
            let merged = tree.cells(&tree.cut(1e-4));
            assert_eq!((merged.len(), merged.levels[0]), (1, 3));
            assert!((merged.thickness[0] / (8.0 * thickness) - 1.0).abs() < 1e-3, "{}", merged.thickness[0]);
            assert!((merged.colors[0] - 0.7).abs() < 1e-5);
        }
    }

    /// Cells are only split where they differ, and where that is visible.
    #[test]
    fn cells_are_split_where_that_shows() {
        let mut cells = cube(|_| 3.0, |code| if code < 256 && code % 2 == 0 { 2.0 } else { 0.0 });
        let split = |cells: &Cells| {
            let tree = Tree::new(cells, 0.01, LEVELS);
            tree.cells(&tree.cut(0.01))
        };
        let chosen = split(&cells);
        assert!(chosen.codes.iter().zip(&chosen.levels).all(|(code, level)| (*code < 256) == (*level == 0)));
        cells.seen.fill(1e-6);
        assert_eq!(split(&cells).len(), 1);
    }

    proptest! {
        /// A higher price never buys more cells. Cells of a cut do not overlap, have the levels that were asked for,
        /// and fill what the tree fills.
        #[test]
        fn prices_limit_the_number_of_cells(
            values in prop::collection::vec((0.0f32..4.0, -1.0f32..1.0), 512),
            prices in (1e-5f32..1.0, 1e-5f32..1.0),
            finest in 0u8..3,
        ) {
            let mut cells = Cells::default();
            for (code, (thickness, light)) in (0..512).zip(&values).filter(|(_, (thickness, _))| *thickness > 1.0) {
                cells.push(code, 0, *thickness, 0.5, &[*light; 3]);
            }
            let tree = Tree::new(&cells, 0.0, LEVELS);
            let counts = [prices.0.min(prices.1), prices.0.max(prices.1)].map(|price| tree.cut(price).count());
            prop_assert!(counts[0] >= counts[1]);
            let levels = [finest, 2];
            let tree = Tree::new(&cells, 0.0, levels);
            let cut = tree.cut(prices.0);
            let chosen = tree.cells(&cut);
            prop_assert_eq!(chosen.len(), cut.count());
            // What no cut has is not missed.
            let least = Tree::new(&cells, prices.0, levels);
            prop_assert_eq!(&least.cells(&least.cut(prices.0)), &chosen);
            prop_assert!(least.starts.len() <= tree.starts.len());
            let mut end = 0;
            for (code, level) in chosen.codes.iter().zip(&chosen.levels) {
                prop_assert!(*code >= end && (levels[0]..=2).contains(level));
                end = code + (1 << (3 * level));
            }
            let covered = |code: &u64| {
                let mut chosen = chosen.codes.iter().zip(&chosen.levels);
                chosen.any(|(first, level)| (*first..first + (1 << (3 * level))).contains(code))
            };
            prop_assert!(cells.codes.iter().all(covered));
        }
    }
}
