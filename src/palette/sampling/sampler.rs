//! Gathering radiance samples on all cores.

use glam::{DVec3, IVec3};
use rayon::prelude::*;

use super::{
    Cancelled, Progress,
    bricks::{Bricks, Depths, ROWS, SIDE},
    directions::observers,
    march::optical_depth,
    path::Path,
};
use crate::{
    field::{LeafCell, PlenOctree},
    palette::{ExtractionSettings, Histograms, InvalidSetting, histogram::Tally},
};

/// Why a field was not sampled.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SamplingError {
    /// A setting is out of its range.
    #[error(transparent)]
    Setting(#[from] InvalidSetting),
    /// [`Progress::cancel`] was called.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Gathers what is visible of a field in histograms, on all cores.
///
/// Every leaf counts, seen from its centre: its density times the transmittance to the edge of the field is the weight of
/// its radiance in that direction. The upper hemisphere is above the field's own up axis. The result has the same bits
/// whatever the number of cores; it differs from float64 throughout by about 1e-6 of the total.
pub fn sample(
    field: &PlenOctree,
    settings: &ExtractionSettings,
    progress: &Progress,
) -> Result<Histograms, SamplingError> {
    settings.validate()?;
    Ok(sample_unchecked(field, settings, progress)?)
}

/// [`sample`] for settings that are known to be valid.
pub(in crate::palette) fn sample_unchecked(
    field: &PlenOctree,
    settings: &ExtractionSettings,
    progress: &Progress,
) -> Result<Histograms, Cancelled> {
    let bricks = Bricks::new(field);
    Sampler::new(field, settings, bricks).run(progress)
}

struct Sampler<'a> {
    field: &'a PlenOctree,
    settings: &'a ExtractionSettings,
    bricks: Option<Bricks>,
    /// The rays of every cell of directions.
    cells: Vec<Vec<Ray>>,
    /// The optical depth above which a leaf is hidden.
    limit: f64,
}

/// A direction in which all leaves are looked at.
struct Ray {
    /// Towards the observer, in finest cells a world unit.
    direction: DVec3,
    /// The basis for the view from the observer.
    basis: [f64; 25],
    path: Path,
}

/// Leaves that are sampled together.
enum Unit {
    /// Leaves of finest size in the same brick: the brick, and each leaf with its row and lane.
    Block(IVec3, Vec<(u32, usize, usize)>),
    /// Any leaf.
    Alone(LeafCell),
}

/// What each thread works with.
struct Worker {
    tally: Tally,
    /// Optical depths of the rays of a cell of directions.
    depths: Vec<Depths>,
    /// Coefficients of the leaves at hand.
    coefficients: Vec<f64>,
}

impl<'a> Sampler<'a> {
    fn new(field: &'a PlenOctree, settings: &'a ExtractionSettings, bricks: Option<Bricks>) -> Self {
        let finest = f64::from(1u32 << field.depth());
        let extent = match (&bricks, field.cell_bounds()) {
            (Some(_), Some((low, high))) => high - low,
            _ => glam::UVec3::ZERO,
        };
        let ray = |observer: DVec3| {
            let direction = observer * field.frame().scale * finest;
            Ray { direction, basis: field.basis().evaluate(-observer), path: Path::new(direction, extent) }
        };
        let cells =
            observers(field.up(), settings).into_iter().map(|cell| cell.into_iter().map(ray).collect()).collect();
        // Where transmittance may fall to 0, this is infinite and nothing is hidden.
        let limit = -settings.stop_transmittance.ln();
        Self { field, settings, bricks, cells, limit }
    }

    fn run(&self, progress: &Progress) -> Result<Histograms, Cancelled> {
        progress.begin(self.field.leaves());
        let most = self.heaviest();
        let start = || Worker {
            tally: Tally::new(self.settings.fine_bins, self.settings.coarse_bins, most),
            depths: vec![[[0.0; SIDE]; ROWS]; self.settings.multisamples.pow(2)],
            coefficients: Vec::new(),
        };
        let tally = self
            .units()
            .par_iter()
            .fold(start, |mut worker, unit| {
                if !progress.is_cancelled() {
                    progress.advance(self.sample(&mut worker, unit));
                }
                worker
            })
            .map(|worker| worker.tally)
            .reduce(|| start().tally, Tally::merge);
        if progress.is_cancelled() {
            return Err(Cancelled);
        }
        Ok(tally.finish((self.field.leaves() * self.cells.len()) as u64))
    }

    /// A bound of the total weight: no leaf weighs more than what its own half leaves of it.
    fn heaviest(&self) -> f64 {
        let finest = f64::from(1u32 << self.field.depth());
        let half_cell = 0.5 / (finest * self.field.frame().scale.max_element());
        let weights = self.field.leaf_cells().map(|cell| {
            let density = f64::from(self.field.densities()[cell.leaf as usize]);
            density * (-density * half_cell * f64::from(cell.size)).exp()
        });
        weights.sum::<f64>() * self.cells.len() as f64
    }

    fn units(&self) -> Vec<Unit> {
        let mut units = Vec::new();
        for cell in self.field.leaf_cells() {
            if cell.size > 1 || self.bricks.is_none() {
                units.push(Unit::Alone(cell));
                continue;
            }
            let side = SIDE as u32;
            let (place, inside) = ((cell.corner / side).as_ivec3(), cell.corner % side);
            let leaf = (cell.leaf, (inside.x * side + inside.y) as usize, inside.z as usize);
            // Leaves come in the order of the octree, so that those of a brick follow each other.
            match units.last_mut() {
                Some(Unit::Block(brick, leaves)) if *brick == place => leaves.push(leaf),
                _ => units.push(Unit::Block(place, vec![leaf])),
            }
        }
        units
    }

    /// Samples leaves from all directions, and tells how many they are.
    fn sample(&self, worker: &mut Worker, unit: &Unit) -> usize {
        let Worker { tally, depths, coefficients } = worker;
        coefficients.clear();
        match unit {
            Unit::Block(place, leaves) => {
                leaves.iter().for_each(|&(leaf, ..)| self.decode(leaf, coefficients));
                let per_leaf = self.field.basis().coefficients();
                let Some(bricks) = &self.bricks else { return leaves.len() };
                for cell in &self.cells {
                    for (ray, depths) in cell.iter().zip(&mut *depths) {
                        depths.as_flattened_mut().fill(f32::INFINITY);
                        leaves.iter().for_each(|&(_, row, lane)| depths[row][lane] = 0.0);
                        bricks.march(*place, &ray.path, self.limit as f32, depths);
                    }
                    for (&(leaf, row, lane), coefficients) in leaves.iter().zip(coefficients.chunks_exact(per_leaf)) {
                        let depth = |ray: usize| f64::from(depths[ray][row][lane]);
                        self.add(tally, leaf, coefficients, cell, depth);
                    }
                }
                leaves.len()
            }
            Unit::Alone(leaf) => {
                self.decode(leaf.leaf, coefficients);
                for cell in &self.cells {
                    let depth = |ray: usize| optical_depth(self.field, *leaf, cell[ray].direction, self.limit);
                    self.add(tally, leaf.leaf, coefficients, cell, depth);
                }
                1
            }
        }
    }

    fn decode(&self, leaf: u32, coefficients: &mut Vec<f64>) {
        let count = self.field.basis().coefficients();
        let stored = &self.field.coefficients()[leaf as usize * count..][..count];
        coefficients.extend(stored.iter().map(|k| k.to_f64()));
    }

    /// Adds the radiance sample of a leaf and a cell of directions, given the optical depth along each ray.
    fn add(&self, tally: &mut Tally, leaf: u32, coefficients: &[f64], cell: &[Ray], depth: impl Fn(usize) -> f64) {
        let functions = self.field.basis().functions();
        let mut color = [0.0; 3];
        let mut transmittance = 0.0;
        for (index, ray) in cell.iter().enumerate() {
            let depth = depth(index);
            if depth > self.limit {
                continue;
            }
            let visible = (-depth).exp();
            transmittance += visible;
            for (color, k) in color.iter_mut().zip(coefficients.chunks_exact(functions)) {
                let sum = k.iter().zip(&ray.basis).map(|(k, y)| k * y).sum();
                *color += visible * self.field.activation().apply(sum);
            }
        }
        if transmittance > 0.0 {
            let density = f64::from(self.field.densities()[leaf as usize]);
            tally.add(color.map(|c| c / transmittance), density * transmittance / cell.len() as f64);
        }
    }
}
