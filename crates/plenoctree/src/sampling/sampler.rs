//! Samples radiance on all cores.

use glam::{DVec3, IVec3, UVec3};
use rayon::prelude::*;

use super::{
    blocks::{Blocks, Depths, ROWS},
    directions::observers,
    leaves::{chosen_leaves, weight_bound},
    march::optical_depth,
    path::{Path, SIDE, Start},
    progress::{Canceled, Progress},
    sample_point::SamplePoint,
};
use crate::field::{LeafCell, PlenOctree};
use crate::histograms::{Histograms, InvalidSetting, SamplingSettings, Tally};

/// An error that occurs when sampling a field.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SamplingError {
    /// A setting is out of range.
    #[error(transparent)]
    Setting(#[from] InvalidSetting),
    /// [`Progress::cancel`] was called.
    #[error(transparent)]
    Canceled(#[from] Canceled),
}

/// Samples the visible radiance of a field into histograms, on all cores.
///
/// Every chosen leaf is seen from its center, in all directions of the settings. The weight of its radiance in a direction is
/// its visibility: its density times the transmittance to the edge of the field. The upper hemisphere is the one above
/// the field's own up axis. In solid fields, whose leaves hide their own centers, leaves are seen from where rays enter
/// them: see [`SamplePoint`].
///
/// Packed fields may record the histograms of the original field ([`PlenOctree::histograms`]). If these match the
/// settings, they are returned, and nothing is sampled.
///
/// The result is the same, bit for bit, on any number of cores. It differs from float64 by less than 1e-6 of the total
/// weight.
///
/// # Errors
///
/// Returns an error if a setting is out of range, or if sampling is canceled.
pub fn sample(
    field: &PlenOctree,
    settings: &SamplingSettings,
    progress: &Progress,
) -> Result<Histograms, SamplingError> {
    settings.validate()?;
    if let Some(histograms) = field.histograms(settings) {
        // Nothing is left to do, which counts as done.
        progress.begin(1);
        progress.advance(1);
        return Ok(histograms);
    }
    let leaves = chosen_leaves(field, settings, progress)?;
    let blocks = if are_scattered(&leaves) { None } else { Blocks::new(field, progress)? };
    let point = SamplePoint::choose(field, settings, progress)?;
    Ok(Sampler::new(field, settings, point, blocks, progress)?.run(&leaves)?)
}

/// Returns whether hardly any two leaves are in the same block. Then, marching their rays together takes longer than
/// marching them one by one.
fn are_scattered(leaves: &[LeafCell]) -> bool {
    // Leaves of a block are consecutive.
    leaves.chunk_by(|a, b| place_of(a).0 == place_of(b).0).count() > leaves.len() / 2
}

/// Returns the place of the block in which the center of a leaf is, in blocks, and the cell of the block there.
fn place_of(leaf: &LeafCell) -> (UVec3, UVec3) {
    let center = leaf.corner + leaf.size / 2;
    (center / SIDE as u32, center % SIDE as u32)
}

pub(super) struct Sampler<'a> {
    pub field: &'a PlenOctree,
    settings: &'a SamplingSettings,
    point: SamplePoint,
    pub blocks: Option<Blocks>,
    /// Rays of every direction cell.
    pub cells: Vec<Vec<Ray>>,
    /// Optical depth above which a leaf is hidden.
    limit: f64,
    pub progress: &'a Progress,
}

/// A direction in which all leaves are seen.
pub(super) struct Ray {
    /// Direction toward the observer, in finest cells per world unit.
    pub direction: DVec3,
    /// Basis functions for the view from the observer.
    pub basis: [f64; 25],
    /// Length of the path from the center of a finest cell to the face where it leaves the cell, in world units.
    half: f64,
    /// From each [`Start`].
    paths: [Path; 2],
}

impl Ray {
    /// Returns the length of the path from the center of a leaf, `size` finest cells wide, to its surface, in world
    /// units.
    pub fn half(&self, size: u32) -> f64 {
        self.half * f64::from(size)
    }
}

/// Leaves that are sampled together.
pub(super) enum Unit {
    /// Leaves whose centers are in the same block and whose rays have the same path.
    Block(BlockUnit),
    /// A leaf of any size.
    Alone(LeafCell),
}

/// Leaves whose centers are in the same block and whose rays have the same path.
pub(super) struct BlockUnit {
    /// The block.
    place: IVec3,
    /// Where the rays start.
    start: Start,
    /// The width, in finest cells, of the leaves that rays do not count: their own, with [`SamplePoint::Entry`].
    skipped: Option<u32>,
    pub leaves: Vec<BlockLeaf>,
}

/// A leaf whose center is in a block.
pub(super) struct BlockLeaf {
    pub leaf: u32,
    /// Its width, in finest cells.
    pub size: u32,
    /// The row and the lane of the cell at its center.
    pub row: usize,
    pub lane: usize,
}

/// The state of a thread.
struct Worker {
    tally: Tally,
    /// Optical depths of the rays of a direction cell.
    depths: Vec<Depths>,
    /// Coefficients of the leaves that are being sampled.
    coefficients: Vec<f64>,
}

impl<'a> Sampler<'a> {
    pub fn new(
        field: &'a PlenOctree,
        settings: &'a SamplingSettings,
        point: SamplePoint,
        blocks: Option<Blocks>,
        progress: &'a Progress,
    ) -> Result<Self, Canceled> {
        // Infinite if the threshold is 0. Then no leaf is hidden.
        let limit = -settings.stop_transmittance.ln();
        Self { field, settings, point, blocks, cells: Vec::new(), limit, progress }
            .seen_from(observers(field.up(), settings))
    }

    /// Returns the sampler with rays toward other observers, as unit vectors in the field's frame.
    pub fn seen_from(self, observers: Vec<Vec<DVec3>>) -> Result<Self, Canceled> {
        let Self { field, progress, .. } = self;
        let finest = f64::from(1u32 << field.depth());
        let extent = match (&self.blocks, field.cell_bounds()) {
            (Some(_), Some((low, high))) => high - low,
            _ => UVec3::ZERO,
        };
        let ray = |observer: DVec3| {
            progress.check()?;
            let direction = observer * field.frame().scale * finest;
            let half = 0.5 * direction.abs().recip().min_element();
            let paths = [Start::Center, Start::Corner].map(|start| Path::new(direction, start, extent));
            Ok(Ray { direction, basis: field.basis().evaluate(-observer), half, paths })
        };
        let cells = observers.into_iter().map(|cell| cell.into_iter().map(ray).collect());
        Ok(Self { cells: cells.collect::<Result<_, Canceled>>()?, ..self })
    }

    /// Samples leaves, each of which stands for as many of the field.
    fn run(&self, leaves: &[LeafCell]) -> Result<Histograms, Canceled> {
        let progress = self.progress;
        progress.begin(leaves.len());
        let most = weight_bound(self.field, self.settings, self.point, progress)?;
        let start = || Worker {
            tally: Tally::new(self.settings.fine_bins, self.settings.coarse_bins, most),
            depths: vec![[[0.0; SIDE]; ROWS]; self.settings.multisamples.pow(2)],
            coefficients: Vec::new(),
        };
        let tally = self
            .units(leaves)?
            .par_iter()
            .fold(start, |mut worker, unit| {
                // Once canceled, the remaining units are skipped, and the samples of this one are discarded.
                if let Ok(leaves) = self.sample(&mut worker, unit) {
                    progress.advance(leaves);
                }
                worker
            })
            .map(|worker| worker.tally)
            .reduce(|| start().tally, Tally::merge);
        progress.check()?;
        // Every sampled leaf stands for all leaves of its stratum.
        let factor = self.field.leaves() as f64 / leaves.len().max(1) as f64;
        Ok(tally.finish(factor, (leaves.len() * self.cells.len()) as u64))
    }

    /// Returns the leaves in groups. Leaves are in the order of the octree.
    pub fn units(&self, leaves: &[LeafCell]) -> Result<Vec<Unit>, Canceled> {
        let mut units = Vec::new();
        // The groups of the current block, by size if rays skip their leaf, and else by start. The center of a leaf that
        // is as wide as a block or wider is in a block of its own.
        let mut open: [Option<BlockUnit>; SIDE.ilog2() as usize + 1] = Default::default();
        for &cell in leaves {
            self.progress.check()?;
            if self.blocks.is_none() {
                units.push(Unit::Alone(cell));
                continue;
            }
            let side = SIDE as u32;
            let (place, inside) = place_of(&cell);
            let place = place.as_ivec3();
            let (row, lane) = ((inside.x * side + inside.y) as usize, inside.z as usize);
            let leaf = BlockLeaf { leaf: cell.leaf, size: cell.size, row, lane };
            let start = Start::of(cell.size);
            let (group, skipped) = match self.point {
                SamplePoint::Center => (start as usize, None),
                SamplePoint::Entry => (cell.size.min(side).ilog2() as usize, Some(cell.size)),
            };
            // Leaves of a block are consecutive.
            match &mut open[group] {
                Some(unit) if unit.place == place => unit.leaves.push(leaf),
                unit => {
                    let next = BlockUnit { place, start, skipped, leaves: vec![leaf] };
                    units.extend(unit.replace(next).map(Unit::Block));
                }
            }
        }
        units.extend(open.into_iter().flatten().map(Unit::Block));
        Ok(units)
    }

    /// Computes the optical depths of a ray from the leaves of a unit, as [`optical_depth`] does. Those of all other
    /// cells are infinite.
    pub fn march(&self, blocks: &Blocks, unit: &BlockUnit, ray: &Ray, limit: f64, depths: &mut Depths) {
        depths.as_flattened_mut().fill(f32::INFINITY);
        unit.leaves.iter().for_each(|leaf| depths[leaf.row][leaf.lane] = 0.0);
        let path = &ray.paths[unit.start as usize];
        // Where rays start at the point where they enter the leaf, it does not hide itself, however dense it is.
        let skipped = unit.skipped.map_or(0, |size| path.steps_within(size));
        blocks.march(unit.place, path, skipped, limit as f32, depths);
    }

    /// Samples leaves in all directions and returns their number.
    fn sample(&self, worker: &mut Worker, unit: &Unit) -> Result<usize, Canceled> {
        self.progress.check()?;
        let Worker { tally, depths, coefficients } = worker;
        coefficients.clear();
        match unit {
            Unit::Block(unit) => {
                let leaves = &unit.leaves;
                leaves.iter().for_each(|leaf| self.decode(leaf.leaf, coefficients));
                let per_leaf = self.field.basis().coefficients();
                let Some(blocks) = &self.blocks else { return Ok(leaves.len()) };
                for cell in &self.cells {
                    for (ray, depths) in cell.iter().zip(&mut *depths) {
                        self.progress.check()?;
                        self.march(blocks, unit, ray, self.limit, depths);
                    }
                    for (leaf, coefficients) in leaves.iter().zip(coefficients.chunks_exact(per_leaf)) {
                        let depth = |ray: usize| f64::from(depths[ray][leaf.row][leaf.lane]);
                        self.add(tally, leaf.leaf, leaf.size, coefficients, cell, depth);
                    }
                }
                Ok(leaves.len())
            }
            Unit::Alone(leaf) => {
                self.decode(leaf.leaf, coefficients);
                for cell in &self.cells {
                    self.progress.check()?;
                    let depth =
                        |ray: usize| optical_depth(self.field, *leaf, cell[ray].direction, self.point, self.limit);
                    self.add(tally, leaf.leaf, leaf.size, coefficients, cell, depth);
                }
                Ok(1)
            }
        }
    }

    fn decode(&self, leaf: u32, coefficients: &mut Vec<f64>) {
        self.field.stored().visit(self.field.basis(), leaf as usize, |_, k| coefficients.push(k));
    }

    /// Adds the radiance sample of a leaf, `size` finest cells wide, in a direction cell, given the optical depth along
    /// each ray.
    fn add(
        &self,
        tally: &mut Tally,
        leaf: u32,
        size: u32,
        coefficients: &[f64],
        cell: &[Ray],
        depth: impl Fn(usize) -> f64,
    ) {
        let density = f64::from(self.field.densities()[leaf as usize]);
        let functions = self.field.basis().functions();
        // Averaging differences from the first color keeps a color that is the same in all directions exact, even on
        // the border of two bins.
        let mut first = [0.0; 3];
        let mut color = [0.0; 3];
        let mut transmittance = 0.0;
        for (index, ray) in cell.iter().enumerate() {
            let depth = depth(index);
            if depth > self.limit {
                continue;
            }
            let visible = (-depth).exp() * self.point.share(density * ray.half(size));
            for (channel, k) in coefficients.chunks_exact(functions).enumerate() {
                let sum = k.iter().zip(&ray.basis).map(|(k, y)| k * y).sum();
                let seen = self.field.activation().apply(sum);
                if transmittance == 0.0 {
                    first[channel] = seen;
                }
                color[channel] += visible * (seen - first[channel]);
            }
            transmittance += visible;
        }
        if transmittance > 0.0 {
            let mean = std::array::from_fn(|channel| first[channel] + color[channel] / transmittance);
            tally.add(mean, density * transmittance / cell.len() as f64);
        }
    }
}

#[cfg(test)]
mod tests;
