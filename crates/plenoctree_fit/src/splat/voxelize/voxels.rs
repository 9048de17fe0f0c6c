//! A capture in cells of all sizes, from which fields are made.

use std::cell::OnceCell;

use plenoctree::PlenOctree;
use rayon::prelude::*;

use super::{
    areas::areas,
    blocks::Lattice,
    choice::{Choice, MOST_CELLS, lattices},
    coarse::Coarse,
    place::{DEPTHS, Place, fault},
    settings::{BLUR, BLURS, FAINTEST, VoxelSettings, per_cell},
    sight::look,
};
use crate::{
    cells::{BLOCK, Cells, Tree, price},
    exponential::exp_minus,
    splat::{error::SplatError, splats::Splats},
};

/// The smallest number of leaves to ask for: that of all blocks at the greatest depth.
const FEWEST_LEAVES: usize = 1 << (3 * (DEPTHS[1] - BLOCK));
/// The largest: 1.2 GB of coefficients of degree 2.
const MOST_LEAVES: usize = 20_000_000;
/// The first depth at which to see how much of the cube is filled.
const FIRST_DEPTH: u32 = 8;
/// The part of the cube in which something is visible, from which on cells are not divided further: it is full of haze.
const MOST_FILLED: f64 = 0.35;
/// The most work of adding up Gaussians, in sums: about half a minute on two cores.
const MOST_WORK: f64 = 8e9;
/// About how many times as many cells as leaves there are at first, before hidden ones are removed.
const SPARE: f64 = 1.5;
/// The smallest error, in areas of the cube's face, for which a cell is split.
const LEAST_PRICE: f64 = 1e-11;

/// A capture in cells of all sizes, from which fields with any number of leaves are made.
pub struct Voxels {
    place: Place,
    /// Levels of the finest cells that the Gaussians were added up in.
    depth: u32,
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
        let place = Place::new(splats, settings)?;
        let leaves = settings.leaves;
        if !(FEWEST_LEAVES..=MOST_LEAVES).contains(&leaves) {
            return Err(fault("leaves", leaves.to_string(), "32768 to 20000000"));
        }
        if !(BLURS[0]..=BLURS[1]).contains(&settings.blur) {
            return Err(fault("blur", settings.blur.to_string(), "0.1 to 0.5 cells"));
        }
        // Merged cells look better than those that Gaussians are added up in.
        let mut most = (settings.depth + 1).min(DEPTHS[1]);
        // Lattices are not kept until they are added up: there are several, of about 100 bytes per Gaussian each.
        let works: [OnceCell<f64>; DEPTHS[1] as usize + 1] = Default::default();
        let lattice = |depth| Lattice::new(splats, place.corner, place.width(depth), depth, BLUR, None);
        let work = |depth: u32| *works[depth as usize].get_or_init(|| lattice(depth).work());
        // Apart from a sample, everything is added up at most once in finest cells, in wide ones and for each coarse
        // look.
        let all_work = |depth: u32| {
            let looks: f64 = (depth.min(FIRST_DEPTH)..=depth).map(|depth| work(depth - 1)).sum();
            looks + work(depth - 1) + work(depth)
        };
        while most > DEPTHS[0] && all_work(most) > MOST_WORK {
            most -= 1;
        }
        let coarse = |depth| Coarse::new(splats, place.corner, place.width(depth), depth, [place.low, place.high]);
        let mut depth = most.min(FIRST_DEPTH);
        let mut seen = coarse(depth);
        while depth < most && seen.filled() < MOST_FILLED {
            depth += 1;
            seen = coarse(depth);
        }
        let blur = settings.blur * f64::from(depth as i32 - settings.depth as i32).exp2().max(1.0);
        let shown = areas(splats, &settings.views, place.width(depth), blur);
        let levels = [depth.saturating_sub(settings.depth) as u8, BLOCK as u8];
        let [finest, wide] = lattices(splats, &place, depth, blur, &shown);
        drop(shown);
        let choice = Choice { place: &place, depth, seen, levels, finest, wide };
        let least_price = (LEAST_PRICE * 4f64.powi(depth as i32)) as f32;
        let price = choice.price((SPARE * leaves as f64) as usize, least_price);
        let Some(mut cells) = choice.cells(price) else {
            let found = format!("{} with more than {MOST_CELLS} cells", settings.depth);
            return Err(fault("depth", found, "a lower depth, fewer leaves or a smaller box"));
        };
        let sights = look(&cells, 1 << depth);
        cells.seen.iter_mut().zip(&sights).for_each(|(seen, sight)| *seen = sight.mean);
        let shows = |cell: usize| {
            let faintest = per_cell(FAINTEST, depth - u32::from(cells.levels[cell]));
            sights[cell].most * (1.0 - exp_minus(cells.thickness[cell])) >= faintest
        };
        let blocks = cells.blocks(shows);
        if blocks.is_empty() {
            return Err(place.empty());
        }
        let trees = blocks.par_iter().map(|cells| Tree::new(cells, least_price, levels)).collect();
        Ok(Self { place, depth, trees, least_price })
    }

    /// Makes the field that looks most like the capture with at most this many leaves, or fewer if more would hardly
    /// look better. Every block of cells keeps one, so with fewer than 32,768, there may be more than requested.
    ///
    /// # Errors
    ///
    /// Returns an error if the cells do not form a field, or if they are so faint that readers of files would drop
    /// them.
    pub fn field(&self, leaves: usize) -> Result<PlenOctree, SplatError> {
        let price = price(&self.trees, leaves).max(self.least_price);
        let cells = |tree: &Tree| tree.cells(&tree.cut(price));
        let cells = Cells::joined(self.trees.par_iter().map(cells).collect());
        self.place.field(&cells, self.depth)
    }
}
