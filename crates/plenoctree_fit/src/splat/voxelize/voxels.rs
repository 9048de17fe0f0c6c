//! A capture in cells of all sizes, from which fields are made.

use std::sync::atomic::{AtomicUsize, Ordering};

use glam::{DVec3, Vec3};
use half::f16;
use plenoctree::{Activation, Basis, Frame, PlenOctree, UpAxis};
use rayon::prelude::*;

use super::{
    THINNEST, VoxelSettings,
    blocks::{BLOCK, Block, Lattice},
    cells::Cells,
    coarse::Coarse,
    colors::Directions,
    sight::look,
    tree::Tree,
};
use crate::{
    exponential::exp_minus,
    finest::position_of,
    splat::{error::SplatError, harmonics::functions, splats::Splats},
};

/// Highest degree of the field's harmonics.
const MOST_DEGREE: u32 = 2;
/// The field's least and greatest depth.
const DEPTHS: [u32; 2] = [6, 10];
/// The smallest number of leaves to ask for: that of all blocks at the greatest depth.
const FEWEST_LEAVES: usize = 1 << (3 * (DEPTHS[1] - BLOCK));
/// The largest: 1.2 GB of coefficients of degree 2.
const MOST_LEAVES: usize = 20_000_000;
/// The largest number of cells in memory.
const MOST_CELLS: usize = 40_000_000;
/// Coarse cells above which cells are twice as large: the Gaussians fill the cube, so that most are large.
const MOST_COARSE: usize = 5_000_000;
/// How many times as many cells as leaves there are at first, before hidden ones are removed.
const SPARE: f64 = 1.5;
/// Of this many blocks, one is used to estimate the price of a cell at first.
const SAMPLED: u64 = 13;
/// The smallest error, in areas of the cube's face, for which a cell is split.
const LEAST_PRICE: f64 = 1e-11;
/// Binary logarithms of the lowest and the highest price to try, and how often to halve the range.
const PRICES: [f32; 2] = [-40.0, 24.0];
const PRICE_STEPS: usize = 14;
/// Opacity that a leaf must add to some ray.
const FAINTEST: f32 = 1e-3;

/// A capture in cells of all sizes, from which fields with any number of leaves are made.
pub struct Voxels {
    corner: DVec3,
    size: f64,
    /// Levels of the finest cells that the Gaussians were added up in.
    depth: u32,
    functions: usize,
    /// The levels of the cells that may become leaves, counted from the finest.
    levels: [u8; 2],
    trees: Vec<Tree>,
    least_price: f32,
}

impl Voxels {
    /// Adds up the Gaussians, on all cores of the current rayon pool. The result is the same on any number of threads.
    /// `settings` are those of [`voxelize`](super::voxelize()).
    ///
    /// # Errors
    ///
    /// Returns an error if a setting is out of range, if nothing in the box is visible, or if there are too many cells
    /// for memory.
    pub fn new(splats: &Splats, settings: &VoxelSettings) -> Result<Self, SplatError> {
        let fault = |setting, found, expected| Err(SplatError::Setting { setting, found, expected });
        if !(DEPTHS[0]..=DEPTHS[1]).contains(&settings.depth) {
            return fault("depth", settings.depth.to_string(), "6 to 10");
        }
        if !(FEWEST_LEAVES..=MOST_LEAVES).contains(&settings.leaves) {
            return fault("leaves", settings.leaves.to_string(), "32768 to 20000000");
        }
        let Some((low, high)) = settings.bounds.or_else(|| splats.dense_bounds()) else {
            return Err(SplatError::Empty { place: "the file".into() });
        };
        if !(low.is_finite() && high.is_finite() && low.cmplt(high).all()) {
            return fault("bounds", format!("{low} to {high}"), "a lowest and a highest corner");
        }
        let size = (high - low).max_element();
        let corner = 0.5 * (low + high) - 0.5 * size;
        let width = |depth: u32| size / f64::from(1u32 << depth);
        // Merged cells are less blurred than those that Gaussians are added up in.
        let mut depth = (settings.depth + 1).min(DEPTHS[1]);
        let mut coarse = Coarse::new(splats, corner, width(depth), depth, [low, high]);
        if coarse.count() > MOST_COARSE {
            depth -= 1;
            coarse = Coarse::new(splats, corner, width(depth), depth, [low, high]);
        }
        let finest = depth.saturating_sub(settings.depth) as u8;
        let levels = [finest, if settings.uniform { finest } else { BLOCK as u8 }];
        let lattice = Lattice::new(splats, corner, width(depth), depth);
        let functions = functions(splats.degree().min(MOST_DEGREE));
        let limits = [(low - corner) / width(depth), (high - corner) / width(depth)];
        let tree = |code: u64, block: &Block| Tree::new(&visible_cells(code, block, &coarse, limits));
        let least_price = if settings.uniform { 0.0 } else { (LEAST_PRICE * 4f64.powi(depth as i32)) as f32 };
        let most = (SPARE * settings.leaves as f64) as usize;
        let sampled = |code: u64| code.is_multiple_of(SAMPLED) && coarse.sees(code);
        let price = if settings.uniform {
            0.0
        } else {
            price(&lattice.blocks(functions, sampled, tree), most / SAMPLED as usize, levels).max(least_price)
        };
        let count = AtomicUsize::new(0);
        let parts = lattice.blocks(
            functions,
            |code| coarse.sees(code),
            |code, block| {
                if count.load(Ordering::Relaxed) > MOST_CELLS {
                    return Cells::default();
                }
                let tree = tree(code, block);
                let cells = tree.cells(&tree.cut(price, levels));
                count.fetch_add(cells.len(), Ordering::Relaxed);
                cells
            },
        );
        if count.into_inner() > MOST_CELLS {
            return fault(
                "depth",
                format!("{} with more than {MOST_CELLS} cells", settings.depth),
                "a lower depth, fewer leaves or a smaller box",
            );
        }
        let mut cells = Cells::joined(parts);
        let sights = look(&cells, 1 << depth);
        cells.seen.iter_mut().zip(&sights).for_each(|(seen, sight)| *seen = sight.mean);
        let shows = |cell: usize| sights[cell].most * (1.0 - exp_minus(cells.thickness[cell])) >= FAINTEST;
        let blocks = cells.blocks(shows);
        if blocks.is_empty() {
            return Err(SplatError::Empty { place: format!("the box from {low:.3} to {high:.3}") });
        }
        let trees = blocks.par_iter().map(Tree::new).collect();
        Ok(Self { corner, size, depth, functions, levels, trees, least_price })
    }

    /// Makes the field that looks most like the capture with at most this many leaves, or fewer if more would hardly
    /// look better. If all leaves have one size, there are as many as there are visible cells.
    ///
    /// # Errors
    ///
    /// Returns an error if the cells do not form a field.
    pub fn field(&self, leaves: usize) -> Result<PlenOctree, SplatError> {
        let price = if self.levels[0] == self.levels[1] { 0.0 } else { price(&self.trees, leaves, self.levels) };
        let price = price.max(self.least_price);
        let cells = |tree: &Tree| tree.cells(&tree.cut(price, self.levels));
        let cells = Cells::joined(self.trees.par_iter().map(cells).collect());
        let directions = Directions::new();
        let finest = self.size / f64::from(1u32 << self.depth);
        let density =
            |(thickness, level): (&f32, &u8)| (f64::from(*thickness) / (finest * f64::from(1u32 << level))) as f32;
        let densities = cells.thickness.iter().zip(&cells.levels).map(density).collect();
        let coefficients = |color: &[f32]| {
            let color: Vec<Vec3> = color.chunks_exact(3).map(Vec3::from_slice).collect();
            directions.convert(&color).into_iter().map(f16::from_f32)
        };
        let coefficients = cells.colors.par_chunks(3 * self.functions).flat_map_iter(coefficients).collect();
        let frame = Frame::spanning(self.corner, self.corner + self.size);
        let basis = Basis::from_functions(self.functions).unwrap_or(Basis::Sh1);
        let nodes = cells.nodes(self.depth);
        Ok(PlenOctree::new(frame, basis, Activation::Sigmoid, UpAxis::Z, nodes, densities, coefficients)?)
    }
}

/// Returns the visible cells of a block. `limits` are the corners of the box outside which there are none, in cells.
fn visible_cells(code: u64, block: &Block, coarse: &Coarse, limits: [DVec3; 2]) -> Cells {
    let mut cells = Cells::default();
    let mut color = Vec::new();
    for inside in 0..1u64 << (3 * BLOCK) {
        let sums = block.cell(position_of(inside));
        if sums[0] < THINNEST {
            continue;
        }
        let code = code << (3 * BLOCK) | inside;
        let position = position_of(code);
        let (seen, center) = (coarse.seen(position), position.as_dvec3() + 0.5);
        if seen > 0.0 && center.cmpge(limits[0]).all() && center.cmple(limits[1]).all() {
            color.clear();
            color.extend(sums[1..].iter().map(|sum| sum / sums[0]));
            cells.push(code, 0, sums[0], seen, &color);
        }
    }
    cells
}

/// Returns the lowest price of a cell with which trees have at most `goal` cells. Prices are powers of two.
fn price(trees: &[Tree], goal: usize, levels: [u8; 2]) -> f32 {
    let count = |price: f32| trees.par_iter().map(|tree| tree.cut(price, levels).count()).sum::<usize>();
    let [mut low, mut high] = PRICES;
    for _ in 0..PRICE_STEPS {
        let middle = 0.5 * (low + high);
        if count(middle.exp2()) > goal { low = middle } else { high = middle }
    }
    high.exp2()
}
