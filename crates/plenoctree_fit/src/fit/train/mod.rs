//! Fits a grid to photographs, stage by stage, from coarse to fine.

mod average;
pub mod backdrop;
pub mod batch;
pub mod gallery;
mod schedule;
pub mod update;
pub mod visibility;

use std::time::Instant;

use glam::{DVec2, UVec3, Vec3};
use plenoctree::random::Random;
use rayon::prelude::*;

use self::{
    average::Average,
    backdrop::Backdrop,
    batch::{Scene, TILE, Tile, Workspace, render_batch},
    gallery::Gallery,
    update::{Optimizer, update},
    visibility::Limits,
};
pub use self::{
    gallery::TrainView,
    schedule::{Position, Schedule, Stage, StageTime},
};
use super::{
    error::FitError,
    grid::{Grid, Voxel, VoxelSet},
    input::ViewCamera,
    progress::FitProgress,
};

/// What the squared error of an opacity counts, relative to that of a color channel. The random colors behind the field
/// require the right opacity, too, but only on average.
const OPACITY: f32 = 2.0;

/// The least tiles after which gains are learned, in all and per view. Large photographs have more tiles than a stage
/// trains on.
const GAIN_TILES: usize = 8192;
const TILES_PER_GAIN: usize = 64;

/// How often a stage shows every picture if they do not fit in memory. The mean at the end of a stage, over its last
/// seventh, is then over all of them.
const PASSES: f64 = 8.0;

/// The pixels that are read in about the time of a ray: reading takes hardly longer than training. On a core, a ray takes
/// 7 µs, and a pixel of a PNG file 40 ns.
const PIXELS_PER_RAY: u64 = 250;

/// The tiles that are drawn at a time from pictures that are soon replaced.
const DRAWN: usize = 1 << 14;

/// The fraction of a stage's usual rays before which no voxels are removed: in a short time, they are hardly trained.
const LEAST_FOR_REMOVAL: f64 = 0.02;

/// Weight on some ray above which a voxel is visible enough to be there in the next stage.
const VISIBLE: f32 = 0.01;

/// The model that is fitted.
pub struct Model {
    pub grid: Grid,
    pub backdrop: Backdrop,
    /// Gain of each view, in encoded sRGB: its exposure, relative to the mean.
    pub gains: Vec<Vec3>,
}

/// Called periodically with the model, its position, the fraction of the stage that is done, and the state of the
/// random numbers.
pub type Watch<'a> = dyn FnMut(&Model, &Position, f64, &Random) + 'a;

/// Returns the time of a stage. Called before its first batch, with the seconds that preparing it took in [`train`].
pub type Limit<'a> = dyn FnMut(f64) -> StageTime + 'a;

/// The tiles that are next, in random order. A stage takes up where the one before ended, so that several short ones
/// show every pixel as often as a long one.
#[derive(Default)]
pub struct Tour {
    tiles: Vec<Tile>,
}

/// Fits `model` for one stage, from `position` on. Returns early if `progress` says so. A `limit` replaces the time of
/// the stage. `tour` is that of a stage before with the same pictures, all of which are in memory, or a new one.
///
/// # Errors
///
/// Returns an error if a picture cannot be read.
pub fn train(
    model: &mut Model,
    gallery: &mut Gallery,
    stage: &Stage,
    position: &mut Position,
    tour: &mut Tour,
    random: &mut Random,
    progress: &FitProgress,
    mut limit: Option<&mut Limit>,
    watch: &mut Watch,
) -> Result<(), FitError> {
    let (start, before) = (Instant::now(), position.seconds);
    let mut stage = stage.clone();
    let mut learner = Learner::new(gallery.len());
    let mut watched = 0.0;
    let mut views = Vec::new();
    // The least fraction of the stage and the fewest rays at which other pictures replace these, if not all are in memory.
    let mut round = None;
    // How many views in a row have not seen anything.
    let mut blind = 0;
    'rounds: while !progress.is_stopped() && (limit.is_some() || stage.fraction(position) < 1.0) {
        if round.is_none() {
            // Not both in memory at a time.
            views.clear();
            views = gallery.next_round(random)?;
        }
        let is_part = views.len() < gallery.len();
        let mut tiles = std::mem::take(&mut tour.tiles);
        let is_new = tiles.is_empty();
        if is_new {
            tiles = active_tiles(&model.grid, &views, is_part.then(|| random.bits()));
        }
        if tiles.is_empty() && is_part {
            // What is in view may be small.
            tiles = active_tiles(&model.grid, &views, None);
        }
        if tiles.is_empty() {
            round = None;
            blind += views.len();
            // At least one of two passes over all views is complete.
            if blind >= 2 * gallery.len() {
                return Err(FitError::Empty);
            }
            continue;
        }
        blind = 0;
        if is_new {
            random.shuffle(&mut tiles);
        }
        for first in (0..tiles.len()).step_by(stage.tiles) {
            position.seconds = before + start.elapsed().as_secs_f64();
            if let Some(limit) = limit.take() {
                stage.time = Some(limit(position.seconds - before));
            }
            let fraction = stage.fraction(position);
            if progress.is_stopped() || fraction >= 1.0 {
                // What is in memory next time are other pictures, if not all are.
                if !is_part {
                    tour.tiles = tiles.split_off(first);
                }
                break;
            }
            if is_part {
                let (end, rays) = *round.get_or_insert_with(|| {
                    let share = views.len() as f64 / gallery.len() as f64 / PASSES;
                    (fraction + share, position.rays + gallery.pixels_read() / PIXELS_PER_RAY)
                });
                if fraction >= end && position.rays >= rays {
                    round = None;
                    continue 'rounds;
                }
            }
            if let Some(&(at, most)) = stage.prune_at.get(position.prunings)
                && fraction >= at
                && stage.trained(position) >= at.min(LEAST_FOR_REMOVAL)
            {
                position.prunings += 1;
                let limits = Limits { most, ..stage.prune_below };
                let set = visibility::visible(&model.grid, &gallery.cameras(), limits);
                model.grid = model.grid.resampled(&set);
                learner.average = Average::default();
                continue 'rounds;
            }
            let tiles = &tiles[first..tiles.len().min(first + stage.tiles)];
            learner.learn(model, &stage, fraction, &views, tiles, random.bits(), position);
            if fraction >= watched {
                watch(model, position, fraction, random);
                watched = fraction + 0.02;
            }
        }
    }
    learner.average.apply(&mut model.grid);
    position.seconds = before + start.elapsed().as_secs_f64();
    Ok(())
}

/// What a stage keeps from batch to batch.
struct Learner {
    workspace: Workspace,
    thickness: Vec<f32>,
    average: Average,
    /// Of each view, the sums of the photographed and the rendered colors of the last tiles, and their number.
    sums: Vec<[Vec3; 2]>,
    summed: usize,
}

impl Learner {
    fn new(views: usize) -> Self {
        let (workspace, average) = (Workspace::default(), Average::default());
        Self { workspace, thickness: Vec::new(), average, sums: vec![[Vec3::ZERO; 2]; views], summed: 0 }
    }

    /// Fits the model to a batch of tiles, and counts its rays and samples. `fraction` is that of the stage which is done.
    fn learn(
        &mut self,
        model: &mut Model,
        stage: &Stage,
        fraction: f64,
        views: &[TrainView],
        tiles: &[Tile],
        seed: u64,
        position: &mut Position,
    ) {
        let knows_opacity = matches!(model.backdrop, Backdrop::Random);
        let scene = Scene {
            grid: &model.grid,
            views,
            backdrop: &model.backdrop,
            gains: &model.gains,
            opacity: if knows_opacity { OPACITY } else { 0.0 },
            fades_near: !knows_opacity,
        };
        render_batch(&scene, tiles, seed, &mut self.workspace);
        let optimizer = Optimizer { rates: stage.rates(fraction), ..stage.optimizer };
        update(&mut model.grid, &self.workspace.parts, &optimizer, &mut self.thickness);
        if stage.average_from.is_some_and(|from| fraction >= from) {
            self.average.add(&model.grid);
        }
        let results = || self.workspace.parts.iter().flat_map(|part| &part.tiles);
        if let Backdrop::Learned(map) = &mut model.backdrop {
            let gradients = results().filter_map(|tile| tile.backdrop);
            map.update(gradients, stage.backdrop_rate(fraction));
        }
        for tile in results() {
            let number = views[tile.view as usize].number;
            position.rays += u64::from(tile.rays);
            (0..2).for_each(|index| self.sums[number][index] += tile.gain[index]);
        }
        position.samples += self.workspace.parts.iter().map(|part| part.samples).sum::<u64>();
        self.summed += tiles.len();
        if stage.learns_gains && self.summed >= GAIN_TILES.max(TILES_PER_GAIN * self.sums.len()) {
            learn_gains(&mut model.gains, &self.sums);
            self.sums.fill([Vec3::ZERO; 2]);
            self.summed = 0;
        }
    }
}

/// Moves the gains halfway to the best ones for the last tiles, and keeps their geometric mean at 1. `sums` are those of
/// the photographed and the rendered colors of each view.
fn learn_gains(gains: &mut [Vec3], sums: &[[Vec3; 2]]) {
    for (gain, [photographed, rendered]) in gains.iter_mut().zip(sums) {
        if rendered.min_element() > 1.0 {
            *gain = (0.5 * (*gain + photographed / rendered)).clamp(Vec3::splat(0.25), Vec3::splat(4.0));
        }
    }
    let logarithms: Vec3 = gains.iter().map(|gain| Vec3::from_array(gain.to_array().map(f32::ln))).sum();
    let mean = (logarithms / gains.len() as f32).to_array().map(f32::exp);
    gains.iter_mut().for_each(|gain| *gain /= Vec3::from_array(mean));
}

/// Returns the tiles in which any corner is known and sees a voxel: of all tiles or, with a `seed`, of about [`DRAWN`]
/// random ones.
fn active_tiles(grid: &Grid, views: &[TrainView], seed: Option<u64>) -> Vec<Tile> {
    let size = |camera: &ViewCamera| (camera.width.div_ceil(TILE), camera.height.div_ceil(TILE));
    let count = |view: &TrainView| (size(&view.camera).0 * size(&view.camera).1) as usize;
    let all: usize = views.iter().map(count).sum();
    // Of fewer tiles, many would be drawn twice.
    let seed = seed.filter(|_| all > 4 * DRAWN);
    let in_view = |(index, view): (usize, &TrainView)| {
        let camera = &view.camera;
        let (columns, count) = (size(camera).0, count(view));
        let sees = |x: u32, y: u32| {
            let (x, y) = (x.min(camera.width - 1), y.min(camera.height - 1));
            if !camera.knows(x, y) {
                return false;
            }
            let pixel = DVec2::new(x.into(), y.into()) + 0.5;
            let mut any = false;
            grid.march(&grid.ray(camera.position, camera.direction(pixel)), |_| {
                any = true;
                false
            });
            any
        };
        let active = |&(x, y): &(u32, u32)| {
            let (left, top) = (x * TILE, y * TILE);
            let (right, bottom) = (left + TILE - 1, top + TILE - 1);
            sees(left, top) || sees(right, bottom) || sees(right, top) || sees(left, bottom)
        };
        let mut random = seed.map(|seed| Random::of(seed, index as u64));
        let place = |tile: usize| {
            let tile = random.as_mut().map_or(tile, |random| random.below(count)) as u32;
            (tile % columns, tile / columns)
        };
        let looked_at = if seed.is_some() { (count * DRAWN).div_ceil(all) } else { count };
        let tile = |(x, y)| Tile { view: index as u32, x: x as u16, y: y as u16 };
        (0..looked_at).map(place).filter(active).map(tile).collect::<Vec<_>>()
    };
    views.par_iter().enumerate().map(in_view).collect::<Vec<_>>().concat()
}

/// Returns the grid for the next stage, with twice the resolution. Visible voxels are split in eight together with
/// their neighbors, those first from which most of the gradient comes, as long as there are few enough. The others
/// stay.
pub fn split(grid: &Grid, cameras: &[&ViewCamera], stage: &Stage) -> Grid {
    let weights = visibility::largest_weights(grid, cameras, 1.0);
    let places: Vec<Voxel> = grid.voxels().collect();
    let mut visible: Vec<usize> = (0..grid.len()).filter(|voxel| weights[*voxel] > VISIBLE).collect();
    visible.sort_by(|a, b| grid.power(*b).total_cmp(&grid.power(*a)));
    let mut fine = VoxelSet::new(2 * grid.resolution());
    let mut is_split = vec![false; grid.len()];
    let mut count = visible.len();
    for &voxel in &visible {
        if count >= stage.most_split {
            break;
        }
        for cell in around(places[voxel], grid.resolution()) {
            match grid.voxel(cell.as_ivec3()) {
                Some(neighbor) => {
                    let was_split = std::mem::replace(&mut is_split[neighbor as usize], true);
                    count += if was_split { 0 } else { 8 };
                }
                // What was left out before may have been there after all, unless the pictures hardly tell.
                None if stage.adds_neighbors && !fine.contains(2 * cell) => {
                    Voxel { corner: 2 * cell, size: 2 }.children().for_each(|child| fine.insert(child));
                    count += 8;
                }
                None => {}
            }
        }
    }
    let insert = |voxel: usize| {
        let Voxel { corner, size } = places[voxel];
        let same = Voxel { corner: 2 * corner, size: 2 * size };
        if is_split[voxel] || same.size > Voxel::LARGEST {
            same.children().for_each(|child| fine.insert(child));
        } else {
            fine.insert(same);
        }
    };
    (0..grid.len()).filter(|voxel| is_split[*voxel] || weights[*voxel] > VISIBLE).for_each(insert);
    grid.resampled(&fine)
}

/// Returns the cells of a voxel and those around it.
fn around(voxel: Voxel, resolution: u32) -> impl Iterator<Item = UVec3> {
    let low = voxel.corner.saturating_sub(UVec3::ONE);
    let size = (voxel.corner + voxel.size + 1).min(UVec3::splat(resolution)) - low;
    let place = move |index: u32| UVec3::new(index / (size.y * size.z), index / size.z % size.y, index % size.z);
    (0..size.element_product()).map(move |index| low + place(index))
}

#[cfg(test)]
mod tests {
    use std::{collections::HashSet, sync::Arc};

    use glam::{DMat3, DVec3};

    use super::*;
    use crate::fit::{grid::Cube, input::Picture};

    /// Of many tiles, some are drawn at random, as many of them from each part of the picture that shows something.
    #[test]
    fn drawn_tiles_are_active_and_spread() {
        let mut set = VoxelSet::new(8);
        for place in 0..512 {
            set.insert(Voxel::cell(UVec3::new(place / 64, place / 8 % 8, place % 8)));
        }
        let grid = Grid::new(Cube { low: DVec3::splat(-0.5), size: 1.0 }, 1, &set);
        // The cube takes up about a quarter of it.
        let size = 1200;
        let camera = ViewCamera::centered([size; 2], 0.5 * f64::from(size), DMat3::IDENTITY, DVec3::new(0.0, 0.0, 1.5));
        let picture = Arc::new(Picture { width: size, height: size, pixels: Vec::new(), knows_opacity: true });
        let views = [TrainView { number: 0, camera, picture }];
        let all = active_tiles(&grid, &views, None);
        let some = active_tiles(&grid, &views, Some(7));
        let share = all.len() as f64 / f64::from((size / TILE).pow(2));
        assert!((0.2..0.3).contains(&share), "{share}");
        let places: HashSet<(u16, u16)> = all.iter().map(|tile| (tile.x, tile.y)).collect();
        assert!(some.iter().all(|tile| places.contains(&(tile.x, tile.y))));
        let expected = share * DRAWN as f64;
        assert!((some.len() as f64 / expected - 1.0).abs() < 0.05, "{} {expected}", some.len());
        let left = some.iter().filter(|tile| u32::from(tile.x) * TILE < size / 2).count();
        assert!((left as f64 / some.len() as f64 - 0.5).abs() < 0.04, "{left} of {}", some.len());
    }

    /// Short stages go on where the one before ended, until every tile has been shown.
    #[test]
    fn stages_share_a_tour() {
        let mut set = VoxelSet::new(8);
        (0..512).for_each(|place| set.insert(Voxel::cell(UVec3::new(place / 64, place / 8 % 8, place % 8))));
        let grid = Grid::new(Cube { low: DVec3::splat(-0.5), size: 1.0 }, 1, &set);
        let size = 500;
        let camera = ViewCamera::centered([size; 2], 400.0, DMat3::IDENTITY, DVec3::new(0.0, 0.0, 1.5));
        let pixels = vec![[0; 4]; (size * size) as usize];
        let picture = Arc::new(Picture { width: size, height: size, pixels, knows_opacity: true });
        let views = vec![TrainView { number: 0, camera, picture }];
        let place = |tile: &Tile| (tile.x, tile.y);
        let mut left: HashSet<(u16, u16)> = active_tiles(&grid, &views, None).iter().map(place).collect();
        let mut gallery = Gallery::held(views);
        let mut model = Model { grid, backdrop: Backdrop::Random, gains: vec![Vec3::ONE] };
        let (mut random, mut tour) = (Random::new(3), Tour::default());
        // A stage without rays is one batch.
        let stage = &Stage::refining(8, 1e-9, None)[0];
        let batches = left.len().div_ceil(stage.tiles);
        assert!(batches > 1, "{batches}");
        for batch in 1..=batches {
            let (progress, mut position) = (FitProgress::default(), Position::default());
            let watch = &mut |_: &Model, _: &Position, _: f64, _: &Random| {};
            train(&mut model, &mut gallery, stage, &mut position, &mut tour, &mut random, &progress, None, watch)
                .unwrap();
            let after: HashSet<(u16, u16)> = tour.tiles.iter().map(place).collect();
            assert!(after.is_subset(&left));
            assert_eq!(left.len() - after.len(), if batch < batches { stage.tiles } else { left.len() });
            left = after;
        }
    }
}
