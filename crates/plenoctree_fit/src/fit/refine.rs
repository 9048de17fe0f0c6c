//! Refines a field until it looks like pictures that are in memory, such as those of a capture.

use std::{sync::Arc, time::Duration};

use glam::{DVec3, Vec3, Vec4};
use plenoctree::{Activation, Basis, LeafCell, PlenOctree, camera::PinholeCamera, random::Random};

use super::{
    error::FitError,
    grid::{Cube, Grid, Voxel, VoxelSet},
    input::{Picture, ViewCamera},
    measure::quick_psnr,
    progress::FitProgress,
    report::{RoundReport, StageReport},
    settings::check_effort,
    to_field::to_merged_field,
    train::{Model, Position, Stage, Tour, TrainView, backdrop::Backdrop, gallery::Gallery, train, visibility::seen},
};

/// The least that a round must be expected to gain, in decibels.
const LEAST_GAIN: f64 = 0.02;
/// The largest leaves, in finest cells a side.
const LARGEST: u32 = 32;
/// Levels of a grid.
const DEPTHS: [u32; 2] = [6, 10];

/// A picture in memory, and the camera that sees it.
#[derive(Clone, Debug)]
pub struct Shot {
    view: TrainView,
}

impl Shot {
    /// Creates a shot. `pixels` are encoded sRGB premultiplied by opacity, and opacity, 0 to 1, row by row.
    ///
    /// # Panics
    ///
    /// Panics if there are not as many pixels as the camera has.
    pub fn new(camera: &PinholeCamera, pixels: &[Vec4]) -> Self {
        let (width, height) = (camera.width, camera.height);
        assert_eq!(pixels.len(), width as usize * height as usize, "one pixel for each pixel of the camera");
        let bytes = |pixel: &Vec4| (255.0 * pixel.clamp(Vec4::ZERO, Vec4::ONE)).round().to_array().map(|x| x as u8);
        let picture = Picture { width, height, pixels: pixels.iter().map(bytes).collect(), knows_opacity: true };
        Self { view: TrainView { number: 0, camera: ViewCamera::pinhole(camera), picture: Arc::new(picture) } }
    }
}

/// Settings of [`refine`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefineSettings {
    /// The most work to do, as a multiple of the default, which is 60 million rays. Above 0, 1 by default.
    pub effort: f64,
    /// The longest time to work for. The result then differs from run to run. `None`, the default, limits the work by
    /// `effort`.
    pub time: Option<Duration>,
    /// Seed of the random numbers. The same seed gives the same field, on any number of threads, unless `time` is set.
    pub seed: u64,
}

impl Default for RefineSettings {
    fn default() -> Self {
        Self { effort: 1.0, time: None, seed: 0 }
    }
}

/// A refined field.
#[derive(Clone, Debug)]
pub struct Refined {
    /// The field, with the frame and the up axis of the original.
    pub field: PlenOctree,
    /// Mean PSNR of the shots that are measured, before refining, in decibels.
    pub before_psnr_db: Option<f64>,
    /// What was done, round by round.
    pub rounds: Vec<RoundReport>,
    /// The number of rounds that the field has gone through. Those after them are undone; if it is 0, all are.
    pub kept: usize,
}

/// A grid that was refined.
pub(super) struct RefinedGrid {
    pub grid: Grid,
    before_psnr_db: Option<f64>,
    rounds: Vec<RoundReport>,
    kept: usize,
}

/// Refines `field` until it looks like the shots, on all cores of the current rayon pool.
///
/// Leaves change density and color, and those that become empty are removed. Leaves of more than four finest cells a
/// side are split, and in the end, leaves are merged where that changes the shots least, so that there are no more than
/// before (but every cube of 32 finest cells a side keeps one). The field is not refined to the `measured` shots, of
/// which up to 16 tell what each of ten rounds gained. Refining ends when a round loses something, when the next one
/// would gain less than 0.02 dB if gains keep falling as they did, or when `progress` is stopped. The result is the
/// field after the best round or, if none gained anything, the field as it was. Without measured shots, it is the field
/// after the last round.
///
/// # Errors
///
/// Returns an error if a setting is out of range, if there are fewer than two shots, if nothing of the field is in
/// view, or if the field is not of the kind that is fitted: a cube of at most 10 levels, with leaves of at most 32
/// finest cells a side, and a sigmoid of harmonics up to degree 3.
pub fn refine(
    field: &PlenOctree,
    shots: &[Shot],
    measured: &[Shot],
    settings: &RefineSettings,
    progress: &FitProgress,
) -> Result<Refined, FitError> {
    check_effort(settings.effort)?;
    if shots.len() < 2 {
        return Err(FitError::Views { found: shots.len().to_string(), expected: "at least two shots" });
    }
    let grid = Grid::of_field_or_error(field, LARGEST)?;
    let training = views(shots);
    let rounds = Stage::refining(grid.resolution(), settings.effort, settings.time);
    let mut gallery = Gallery::held(training.clone());
    let RefinedGrid { grid, before_psnr_db, rounds, kept } =
        refine_by(grid, &mut gallery, measured, &rounds, settings.seed, progress)?;
    // Merging would change even a grid that is as it was.
    if kept == 0 {
        return Ok(Refined { field: field.clone(), before_psnr_db, rounds, kept });
    }
    let refined = to_merged_field(&grid, &seen(&grid, &training), field.leaves())?;
    let refined = refined.with_up(field.up());
    Ok(Refined { field: refined, before_psnr_db, rounds, kept })
}

/// Returns the views of the shots, numbered in their order.
pub(super) fn views(shots: &[Shot]) -> Vec<TrainView> {
    shots.iter().enumerate().map(|(number, shot)| TrainView { number, ..shot.view.clone() }).collect()
}

/// Refines a grid by as many of the stages as pay, like [`refine`]. Without shots to measure, all are kept.
pub(super) fn refine_by(
    grid: Grid,
    gallery: &mut Gallery,
    measured: &[Shot],
    stages: &[Stage],
    seed: u64,
    progress: &FitProgress,
) -> Result<RefinedGrid, FitError> {
    let measured = views(measured);
    let measure = |model: &Model| quick_psnr(&model.grid, &model.backdrop, &measured);
    let gains = vec![Vec3::ONE; gallery.len()];
    let mut model = Model { grid, backdrop: Backdrop::Random, gains };
    let (mut random, mut tour) = (Random::new(seed), Tour::default());
    let before_psnr_db = measure(&model);
    // What is kept: the number of rounds, the PSNR and the values.
    let (mut psnr, mut kept, mut most) = (before_psnr_db, 0, before_psnr_db);
    let mut best = if psnr.is_some() { model.grid.values.clone() } else { Vec::new() };
    let mut rounds: Vec<RoundReport> = Vec::new();
    assert!(best.is_empty() || stages.iter().all(|stage| stage.prune_at.is_empty()), "values of the same voxels");
    for (index, stage) in stages.iter().enumerate() {
        let gain = rounds.last().and_then(|round| round.gain_db);
        let mut position = Position::default();
        let mut watch = |_: &Model, _: &Position, fraction: f64, _: &Random| {
            progress.update(|status| {
                status.stage = "refining".into();
                status.fraction = (index as f64 + fraction) / stages.len() as f64;
                (status.psnr, status.gain) = (psnr, gain);
            });
        };
        train(&mut model, gallery, stage, &mut position, &mut tour, &mut random, progress, None, &mut watch)?;
        let after = measure(&model);
        let gain_db = psnr.zip(after).map(|(before, after)| after - before);
        rounds.push(RoundReport { stage: StageReport::new(&model, &position, after), gain_db });
        if after.is_none() {
            kept = rounds.len();
        } else if after > most {
            (kept, most) = (rounds.len(), after);
            best.clone_from(&model.grid.values);
        }
        psnr = after;
        let gains: Vec<f64> = rounds.iter().filter_map(|round| round.gain_db).collect();
        let ends = gain_db.is_some_and(|gain| gain < 0.0) || next_gain(&gains) < LEAST_GAIN;
        if progress.is_stopped() || ends {
            break;
        }
    }
    if kept < rounds.len() {
        model.grid.values = best;
        model.grid.copy_thickness();
    }
    Ok(RefinedGrid { grid: model.grid, before_psnr_db, rounds, kept })
}

/// Returns what the next round gains if gains keep falling as they did.
fn next_gain(gains: &[f64]) -> f64 {
    match gains {
        [.., before, last] if last < before => last * last / before,
        [.., last] => *last,
        [] => f64::INFINITY,
    }
}

impl Grid {
    /// Returns the grid of a field's leaves, which are at most `largest` finest cells wide. Larger ones than voxels
    /// become several.
    pub(super) fn of_field_or_error(field: &PlenOctree, largest: u32) -> Result<Self, FitError> {
        Self::of_field(field, largest).ok_or_else(|| FitError::Setting {
            setting: "field",
            found: format!(
                "{} leaves at depth {}, {:?} of {}",
                field.leaves(),
                field.depth(),
                field.activation(),
                field.basis().name()
            ),
            expected: if largest > Voxel::LARGEST {
                "a cube of at most 10 levels, leaves at most 32 finest cells wide, a sigmoid of SH1, SH4, SH9 or SH16"
            } else {
                "a cube of 6 to 10 levels, leaves at most 4 finest cells wide, a sigmoid of SH1, SH4, SH9 or SH16"
            },
        })
    }

    /// Returns the grid of a field's leaves, or `None` if the field is not like those that are fitted.
    fn of_field(field: &PlenOctree, largest: u32) -> Option<Self> {
        let basis = [Basis::Sh1, Basis::Sh4, Basis::Sh9, Basis::Sh16].contains(&field.basis());
        let scale = field.frame().scale;
        let cube = (scale.max_element() - scale.min_element()) <= 1e-9 * scale.max_element();
        // What is refined may have large leaves only.
        let finest = if largest > Voxel::LARGEST { field.depth().max(DEPTHS[0]) } else { field.depth() };
        let depth = (DEPTHS[0]..=DEPTHS[1]).contains(&finest);
        if !basis || !cube || !depth || field.activation() != Activation::Sigmoid {
            return None;
        }
        let mut set = VoxelSet::new(1 << finest);
        let place = |LeafCell { corner, size, .. }: LeafCell| {
            let parts = 1 << (finest - field.depth());
            Voxel { corner: parts * corner, size: parts * size }
        };
        for cell in field.leaf_cells() {
            if cell.size > largest {
                return None;
            }
            place(cell).parts().for_each(|voxel| set.insert(voxel));
        }
        let size = 1.0 / scale.x;
        let functions = field.basis().functions();
        let mut grid = Self::new(Cube { low: field.frame().to_world(DVec3::ZERO), size }, functions, &set);
        let width = grid.cell_size();
        let coefficients = field.coefficients();
        for cell in field.leaf_cells() {
            let leaf = cell.leaf as usize;
            let own = &coefficients[leaf * 3 * functions..][..3 * functions];
            for part in place(cell).parts() {
                let Some(voxel) = grid.voxel(part.corner.as_ivec3()) else { continue };
                let values = &mut grid.values[voxel as usize * functions..][..functions];
                for (function, value) in values.iter_mut().enumerate() {
                    let [r, g, b] = [0, 1, 2].map(|channel| own[channel * functions + function].to_f32());
                    *value = Vec4::new(r, g, b, 0.0);
                }
                values[0].w = (f64::from(field.densities()[leaf]) * width) as f32;
            }
        }
        grid.copy_thickness();
        Some(grid)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Converting a field to a grid and back restores it, whatever the sizes of its leaves.
    #[test]
    fn grids_of_fields_give_them_back() {
        let leaves = [(3, 0), (8, 1), (77, 0), (4096, 4), (200_000, 0)];
        let nodes = crate::finest::tree_of(&leaves, 6);
        let frame = plenoctree::Frame::spanning(DVec3::new(-1.0, 2.0, 0.5), DVec3::new(3.0, 6.0, 4.5));
        let densities: Vec<f32> = (1..=5).map(|index| index as f32).collect();
        let coefficients: Vec<half::f16> = (0..60).map(|index| half::f16::from_f32(index as f32 * 0.25)).collect();
        let (basis, up) = (Basis::Sh4, plenoctree::UpAxis::Z);
        let field = PlenOctree::new(frame, basis, Activation::Sigmoid, up, nodes, densities, coefficients).unwrap();
        let grid = Grid::of_field(&field, LARGEST).unwrap();
        let again = to_merged_field(&grid, &vec![1e-6; grid.len()], field.leaves()).unwrap();
        assert_eq!(again.nodes(), field.nodes());
        assert_eq!(again.coefficients(), field.coefficients());
        for (a, b) in again.densities().iter().zip(field.densities().iter()) {
            assert!((a / b - 1.0).abs() < 1e-5, "{a} {b}");
        }
        assert!((again.frame().to_world(DVec3::ONE) - DVec3::new(3.0, 6.0, 4.5)).length() < 1e-9);
    }
}
