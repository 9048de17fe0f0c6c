//! Samples radiance on all cores.

use glam::{DVec3, IVec3};
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
/// Every leaf is seen from its center, in all directions of the settings. The weight of its radiance in a direction is
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
        return Ok(histograms);
    }
    let blocks = Blocks::new(field, progress)?;
    let point = SamplePoint::choose(field, settings, progress)?;
    Ok(Sampler::new(field, settings, point, blocks, progress)?.run()?)
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
        let finest = f64::from(1u32 << field.depth());
        let extent = match (&blocks, field.cell_bounds()) {
            (Some(_), Some((low, high))) => high - low,
            _ => glam::UVec3::ZERO,
        };
        let ray = |observer: DVec3| {
            progress.check()?;
            let direction = observer * field.frame().scale * finest;
            let half = 0.5 * direction.abs().recip().min_element();
            let paths = [Start::Center, Start::Corner].map(|start| Path::new(direction, start, extent));
            Ok(Ray { direction, basis: field.basis().evaluate(-observer), half, paths })
        };
        let cells = observers(field.up(), settings).into_iter().map(|cell| cell.into_iter().map(ray).collect());
        let cells = cells.collect::<Result<_, Canceled>>()?;
        // Infinite if the threshold is 0. Then no leaf is hidden.
        let limit = -settings.stop_transmittance.ln();
        Ok(Self { field, settings, point, blocks, cells, limit, progress })
    }

    fn run(&self) -> Result<Histograms, Canceled> {
        let progress = self.progress;
        let chosen = chosen_leaves(self.field, self.settings, progress)?;
        progress.begin(chosen.len());
        let most = weight_bound(self.field, self.settings, self.point, progress)?;
        let start = || Worker {
            tally: Tally::new(self.settings.fine_bins, self.settings.coarse_bins, most),
            depths: vec![[[0.0; SIDE]; ROWS]; self.settings.multisamples.pow(2)],
            coefficients: Vec::new(),
        };
        let tally = self
            .units(&chosen)?
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
        let factor = self.field.leaves() as f64 / chosen.len().max(1) as f64;
        Ok(tally.finish(factor, (chosen.len() * self.cells.len()) as u64))
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
            let center = cell.corner + cell.size / 2;
            let (place, inside) = ((center / side).as_ivec3(), center % side);
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
mod tests {
    use std::time::{Duration, Instant};

    use glam::UVec3;
    use half::f16;
    use proptest::prelude::*;

    use super::*;
    use crate::{
        bake::{BakeSettings, bake},
        field::{Activation, Basis, Cell, Frame, UpAxis},
        pack::{PackSettings, Packed},
        reference::sample_histograms,
        sampling::{ObserverRegion, SamplingPlan},
    };

    /// Returns a pseudorandom sequence of numbers in [0, 1).
    fn numbers(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed.wrapping_mul(2).wrapping_add(1);
        move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            ((state >> 33) as f64) / (1u64 << 31) as f64
        }
    }

    /// Returns a random field of at most `depth` levels, in which cells of every level may be leaves, empty or
    /// subdivided.
    fn field(seed: u64, depth: u32, scale: [f64; 3], up: UpAxis) -> PlenOctree {
        let mut next = numbers(seed);
        let mut nodes = vec![[Cell::EMPTY; 8]];
        let mut density = Vec::new();
        let mut queue = vec![(0, 1)];
        while let Some((node, level)) = queue.pop() {
            for part in 0..8 {
                let kind = next();
                nodes[node as usize][part] = if level < depth && kind < 0.6 {
                    let child = nodes.len() as u32;
                    nodes.push([Cell::EMPTY; 8]);
                    queue.push((child, level + 1));
                    Cell::node(child)
                } else if kind < if level == depth { 0.5 } else { 0.65 } {
                    density.push((40.0f64 * next() * next() + 0.01) as f32);
                    Cell::leaf(density.len() as u32 - 1)
                } else {
                    Cell::EMPTY
                };
            }
        }
        let coefficients = (0..density.len() * 27).map(|_| f16::from_f64(4.0 * next() - 2.0)).collect();
        let frame = Frame { offset: DVec3::new(0.5, 0.4, 0.3), scale: scale.into() };
        PlenOctree::new(frame, Basis::Sh9, Activation::Sigmoid, up, nodes, density, coefficients).unwrap()
    }

    fn settings(observers: ObserverRegion) -> SamplingSettings {
        SamplingSettings { observers, ..Default::default() }
    }

    fn blocks(field: &PlenOctree) -> Option<Blocks> {
        Blocks::new(field, &Progress::default()).unwrap()
    }

    fn difference(a: &Histograms, b: &Histograms) -> f64 {
        let of = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f64>();
        (of(a.fine(), b.fine()) + of(a.coarse(), b.coarse())) / b.total_weight()
    }

    /// Fields with leaves of all sizes, sampled in every direction, agree with float64, also if their frame is not a
    /// cube. The seeds are fixed because rounding may move a sample next to the border of a bin into another bin.
    #[test]
    fn histograms_match_float64() {
        for (seed, scale, observers, up) in [
            (1, [0.4, 0.4, 0.4], ObserverRegion::UpperHemisphere, UpAxis::Z),
            (2, [0.4, 0.9, 0.1], ObserverRegion::Sphere, UpAxis::Z),
            (3, [2.0, 0.3, 0.5], ObserverRegion::UpperHemisphere, UpAxis::Y),
        ] {
            let field = field(seed, 5, scale, up);
            let settings = settings(observers);
            let found = sample(&field, &settings, &Progress::default()).unwrap();
            let expected = sample_histograms(&field, &settings).unwrap();
            assert!(found.total_weight() > 0.0 && blocks(&field).is_some());
            assert!(difference(&found, &expected) < 1e-6, "{}", difference(&found, &expected));
            assert_eq!(found.samples(), expected.samples());
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]
        /// Marching blocks and marching single rays give the same visibility for any tree. (A single bin, so that
        /// borders of bins do not matter.)
        #[test]
        fn blocks_and_single_rays_agree(
            seed: u64,
            depth in 1u32..6,
            scale in prop::array::uniform3(0.1..3.0f64),
            stop in prop_oneof![Just(0.0), Just(1e-2), 0.0..0.9f64],
            point in prop_oneof![Just(SamplePoint::Center), Just(SamplePoint::Entry)],
        ) {
            let field = field(seed, depth, scale, UpAxis::Z);
            let settings = SamplingSettings {
                stop_transmittance: stop,
                fine_bins: 1,
                coarse_bins: 1,
                ..settings(ObserverRegion::Sphere)
            };
            let progress = Progress::default();
            let run = |blocks| Sampler::new(&field, &settings, point, blocks, &progress).unwrap().run().unwrap();
            let (blocks, single) = (run(blocks(&field)), run(None));
            prop_assert!((blocks.total_weight() - single.total_weight()).abs() <= 1e-5 * single.total_weight());
        }
    }

    /// Leaves of all sizes are sampled in blocks, and much of the work of larger ones is shared, too.
    #[test]
    fn leaves_of_all_sizes_are_sampled_in_blocks() {
        let field = field(5, 6, [0.4; 3], UpAxis::Z);
        let (settings, progress) = (settings(ObserverRegion::Sphere), Progress::default());
        let leaves = chosen_leaves(&field, &settings, &progress).unwrap();
        let sampler = Sampler::new(&field, &settings, SamplePoint::Center, blocks(&field), &progress).unwrap();
        let units = sampler.units(&leaves).unwrap();
        let mut found = Vec::new();
        for unit in &units {
            let Unit::Block(unit) = unit else { panic!("a leaf alone") };
            found.extend(unit.leaves.iter().map(|leaf| leaf.leaf));
        }
        found.sort_unstable();
        assert!(found.iter().copied().eq(0..field.leaves() as u32));
        let larger = leaves.iter().filter(|cell| cell.size > 1).count();
        let shared = units.iter().filter(|unit| matches!(unit, Unit::Block(unit) if unit.start == Start::Corner));
        assert!(larger > 2 * shared.count(), "{larger}");
    }

    /// The coefficients of packed fields are not rounded to half precision first.
    #[test]
    #[cfg(feature = "write")]
    fn histograms_of_packed_fields_match_float64() {
        for (seed, observers, up) in
            [(4, ObserverRegion::UpperHemisphere, UpAxis::Y), (5, ObserverRegion::Sphere, UpAxis::Z)]
        {
            let field = field(seed, 4, [0.4, 0.5, 0.6], up);
            let settings = settings(observers);
            let packed = Packed::new(&field, &PackSettings::default(), &Progress::default()).unwrap();
            let bins = SamplingSettings { fine_bins: 30, ..settings };
            let found = sample(packed.field(), &bins, &Progress::default()).unwrap();
            let expected = sample_histograms(packed.field(), &bins).unwrap();
            assert!(packed.field().codebook().is_some() && found.total_weight() > 0.0);
            assert!(difference(&found, &expected) < 1e-6, "{}", difference(&found, &expected));
        }
    }

    /// Returns a ball of depth 4 of this density, in a haze, in colors that depend on place and direction.
    fn ball(density: f64, haze: f64) -> PlenOctree {
        let settings = BakeSettings { depth: 4, basis: Basis::Sh4, ..Default::default() };
        let tint = |at: DVec3| move |direction: DVec3| 0.5 + 0.3 * at + 0.1 * direction;
        let inside = |at: DVec3| if at.length() < 0.7 { density } else { haze };
        bake(&settings, inside, tint).unwrap()
    }

    /// A solid ball shows its colors however dense it is, as in float64.
    #[test]
    fn solid_fields_are_sampled_where_rays_enter_them() {
        for (observers, haze) in [(ObserverRegion::UpperHemisphere, 0.0), (ObserverRegion::Sphere, 0.02)] {
            for (density, stop) in [(1e3, 1e-2), (1e4, 1e-2), (1e6, 0.5), (1e6, 0.0), (1e30, 1e-2)] {
                let field = ball(density, haze);
                let settings = SamplingSettings { stop_transmittance: stop, ..settings(observers) };
                let found = sample(&field, &settings, &Progress::default()).unwrap();
                let expected = sample_histograms(&field, &settings).unwrap();
                assert!(found.total_weight() > 0.0);
                assert!(difference(&found, &expected) < 1e-6, "{density}: {}", difference(&found, &expected));
                let single = {
                    let progress = Progress::default();
                    Sampler::new(&field, &settings, SamplePoint::Entry, None, &progress).unwrap().run().unwrap()
                };
                assert!(difference(&single, &expected) < 1e-6, "{density}: {}", difference(&single, &expected));
                // Beyond some density, nothing changes any more: rays see the surface.
                let denser = sample(&ball(10.0 * density, haze), &settings, &Progress::default()).unwrap();
                assert!(difference(&found, &denser) < 200.0 / density + 1e-6, "{density}");
            }
        }
    }

    /// Leaves that hide themselves do not matter as long as they are less than half of what observers see.
    #[test]
    fn other_fields_are_sampled_at_the_centers_of_leaves() {
        let settings = BakeSettings { depth: 5, basis: Basis::Rgba, ..Default::default() };
        let cut = |height: f64| {
            let inside = move |at: DVec3| if at.z > height { 1e6 } else { 60.0 };
            let field = bake(&settings, inside, |_| |_| DVec3::ONE).unwrap();
            let observers = self::settings(ObserverRegion::Sphere);
            SamplePoint::choose(&field, &observers, &Progress::default()).unwrap()
        };
        assert_eq!([cut(1.0), cut(0.4), cut(-0.4)], [SamplePoint::Center, SamplePoint::Center, SamplePoint::Entry]);
    }

    /// A leaf that is alone in its field is only occluded by its own cell, so its weight is known.
    #[test]
    fn a_single_leaf_is_occluded_by_half_of_its_cell() {
        let mut nodes = vec![[Cell::EMPTY; 8]; 3];
        (nodes[0][3], nodes[1][5], nodes[2][6]) = (Cell::node(1), Cell::node(2), Cell::leaf(0));
        let frame = Frame { offset: DVec3::ZERO, scale: DVec3::splat(0.5) };
        let coefficients = vec![f16::from_f64(0.75), f16::from_f64(0.25), f16::from_f64(0.5)];
        let field =
            PlenOctree::new(frame, Basis::Rgba, Activation::Identity, UpAxis::Z, nodes, vec![3.0], coefficients)
                .unwrap();
        let histograms = sample(&field, &settings(ObserverRegion::UpperHemisphere), &Progress::default()).unwrap();
        // The cell is 1/8 of the cube, or 1/4 of a world unit, wide.
        let rays: Vec<DVec3> =
            observers(UpAxis::Z, &settings(ObserverRegion::UpperHemisphere)).into_iter().flatten().collect();
        let weight = |ray: &DVec3| 3.0 * (-3.0 * 0.125 / ray.abs().max_element()).exp();
        let expected = rays.iter().map(weight).sum::<f64>() / 4.0;
        let found = histograms.fine()[(24 * 32 + 8) * 32 + 16];
        assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
        assert!((histograms.total_weight() / found - 1.0).abs() < 1e-12);
    }

    #[test]
    fn any_number_of_threads_gives_the_same_bits() {
        let field = field(7, 5, [0.4; 3], UpAxis::Z);
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| sample(&field, &settings(ObserverRegion::UpperHemisphere), &Progress::default())).unwrap()
        };
        assert_eq!(on(1), on(2));
        assert_eq!(on(1), on(5));
    }

    /// A tree of the maximum depth is too deep for a lattice, but is sampled correctly.
    #[test]
    fn deep_trees_are_sampled() {
        let depth = crate::field::MAX_DEPTH as usize;
        let mut nodes = vec![[Cell::EMPTY; 8]; depth];
        for (level, node) in nodes.iter_mut().enumerate().take(depth - 1) {
            (node[0], node[7]) = (Cell::leaf(level as u32), Cell::node(level as u32 + 1));
        }
        nodes[depth - 1][3] = Cell::leaf(depth as u32 - 1);
        let frame = Frame::spanning(DVec3::ZERO, DVec3::ONE);
        let coefficients = vec![f16::ZERO; 3 * depth];
        let densities = vec![1.0; depth];
        let field =
            PlenOctree::new(frame, Basis::Sh1, Activation::Sigmoid, UpAxis::Z, nodes, densities, coefficients).unwrap();
        assert!(blocks(&field).is_none());
        let settings = settings(ObserverRegion::Sphere);
        let found = sample(&field, &settings, &Progress::default()).unwrap();
        let expected = sample_histograms(&field, &settings).unwrap();
        assert!(difference(&found, &expected) < 1e-9);
    }

    #[test]
    fn empty_fields_have_no_weight() {
        let frame = Frame::spanning(DVec3::ZERO, DVec3::ONE);
        let nodes = vec![[Cell::EMPTY; 8]];
        let field = PlenOctree::new(frame, Basis::Sh1, Activation::Sigmoid, UpAxis::Z, nodes, vec![], vec![]).unwrap();
        assert_eq!(field.cell_bounds(), None::<(UVec3, UVec3)>);
        let histograms = sample(&field, &SamplingSettings::default(), &Progress::default()).unwrap();
        assert_eq!((histograms.total_weight(), histograms.samples()), (0.0, 0));
    }

    #[test]
    fn progress_ends_at_one() {
        let field = field(1, 4, [0.4; 3], UpAxis::Z);
        let progress = Progress::default();
        assert_eq!(progress.fraction(), 0.0);
        sample(&field, &SamplingSettings::default(), &progress).unwrap();
        assert_eq!(progress.fraction(), 1.0);
    }

    /// Every step looks at whether it is canceled, so no step before it has to.
    #[test]
    fn every_step_can_be_canceled() {
        let field = field(1, 4, [0.4; 3], UpAxis::Z);
        let (settings, progress, canceled) = (SamplingSettings::default(), Progress::default(), Progress::default());
        let leaves = chosen_leaves(&field, &settings, &progress).unwrap();
        canceled.cancel();
        let sampler = || Sampler::new(&field, &settings, SamplePoint::Center, blocks(&field), &progress).unwrap();
        assert!(Blocks::new(&field, &canceled).is_err());
        assert!(Sampler::new(&field, &settings, SamplePoint::Center, None, &canceled).is_err());
        assert!(chosen_leaves(&field, &settings, &canceled).is_err());
        assert!(weight_bound(&field, &settings, SamplePoint::Center, &canceled).is_err());
        assert!(SamplingPlan::new(&field, &settings, &canceled).is_err());
        let canceled_sampler = Sampler { progress: &canceled, ..sampler() };
        assert!(canceled_sampler.units(&leaves).is_err());
        let units = sampler().units(&leaves).unwrap();
        let mut worker = Worker { tally: Tally::new(1, 1, 1.0), depths: Vec::new(), coefficients: Vec::new() };
        assert!(units.iter().all(|unit| canceled_sampler.sample(&mut worker, unit).is_err()));
        assert_eq!(sample(&field, &settings, &canceled), Err(SamplingError::Canceled(Canceled)));
    }

    /// Sampling two million leaves with as many rays as settings allow would take an hour.
    #[test]
    fn a_large_field_stops_within_50_milliseconds() {
        let settings = BakeSettings { depth: 7, basis: Basis::Rgba, directions: 1, ..Default::default() };
        let field = bake(&settings, |_| 1.0, |at| move |_: DVec3| 0.5 + 0.4 * at).unwrap();
        let settings = SamplingSettings { multisamples: 16, stop_transmittance: 0.0, ..Default::default() };
        // While planning, after a few milliseconds, and while sampling, once the first leaves are done.
        for after in [Some(0), Some(10), Some(50), Some(200), None] {
            let time = || {
                let progress = Progress::default();
                std::thread::scope(|scope| {
                    let worker = scope.spawn(|| (sample(&field, &settings, &progress), Instant::now()));
                    match after {
                        Some(milliseconds) => std::thread::sleep(Duration::from_millis(milliseconds)),
                        None => {
                            while progress.fraction() == 0.0 {
                                std::thread::sleep(Duration::from_millis(1));
                            }
                        }
                    }
                    let start = Instant::now();
                    progress.cancel();
                    let (result, end) = worker.join().unwrap();
                    assert_eq!(result, Err(SamplingError::Canceled(Canceled)));
                    end.saturating_duration_since(start)
                })
            };
            // Other processes may need the cores at any one time, but not always.
            let fastest = (0..3).map(|_| time()).min().unwrap();
            assert!(fastest.as_millis() < 50, "after {after:?} ms: {fastest:?}");
        }
    }
}
