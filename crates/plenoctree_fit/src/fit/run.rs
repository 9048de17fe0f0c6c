//! Runs a fit from input to field.

use std::{
    cell::Cell,
    collections::HashMap,
    fs,
    hash::{DefaultHasher, Hash, Hasher},
    path::PathBuf,
    sync::Arc,
    time::{Duration, Instant},
};

use glam::{DMat3, DVec3, Vec3};
use plenoctree::{PlenOctree, random::Random};

use super::{
    checkpoint::Checkpoint,
    error::FitError,
    grid::{Cube, Grid},
    input::{CameraMaker, FitInput, Picture, View, ViewCamera},
    measure::{Comparison, compare, quick_psnr},
    progress::FitProgress,
    report::{FitReport, HeldOut, Seconds, StageReport, ViewReport},
    scene::{self, Place},
    settings::FitSettings,
    stand,
    suspects::suspicious,
    to_field::{cropped, largest_part, to_field},
    train::{
        Limit, Model, Position, Schedule, StageTime, Tour, TrainView, backdrop::Backdrop, gallery::Gallery, split,
        train, visibility, visibility::Limits,
    },
    turned_box::TurnedBox,
};

/// Maximum number of held-out views that are kept as previews.
const MOST_PREVIEWS: usize = 12;
/// Thickness that voxels start with.
const FIRST_THICKNESS: f32 = 0.03;
/// Of this many pictures, at least one must have transparent pixels, so that opacity tells the object from its
/// background: some photographs have single transparent pixels, and the object may fill most pictures.
const FEWEST_TRANSPARENT: usize = 4;
/// How often a checkpoint is written.
const SAVE_EVERY: Duration = Duration::from_secs(60);
/// The fraction of a stage's usual rays below which there is no time for finer stages: they would hardly be trained.
const LEAST_FOR_FINER: f64 = 0.05;

/// A fitted field.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The field, in the frame of the cameras.
    pub field: PlenOctree,
    /// Held-out views next to their photographs: all of them, or some if there are many.
    pub previews: Vec<Comparison>,
    /// The report.
    pub report: FitReport,
}

/// Fits a field to the views of `input`, on all cores of the current rayon pool.
///
/// The result is measured on views that are held out, by default every eighth ([`FitSettings::hold_out`]), or on the
/// views of `test`. The same input, settings and seed give the same field on any number of threads, unless there is a
/// time limit. If `progress` is stopped, the result is the field at that time.
///
/// # Errors
///
/// Returns an error if a setting is out of range, if a picture cannot be read, if there are fewer than two views to fit
/// to, if they do not show a common object, if nothing is left of the field, or if `progress` is stopped before
/// training starts.
pub fn fit(
    input: &FitInput,
    test: Option<&FitInput>,
    settings: &FitSettings,
    progress: &FitProgress,
) -> Result<Fitted, FitError> {
    settings.validate()?;
    let start = Instant::now();
    progress.update(|status| status.stage = "reading".into());
    let (turned, agreement) = settings.stand.then(|| stand::upright(&input.views)).unzip();
    let turn = |input: &FitInput| turned.map_or_else(|| input.clone(), |turn| stand::turned(input, turn));
    let (input, test) = (&turn(input), test.map(turn));
    let is_held_out = |index: usize| test.is_none() && settings.holds_out(index);
    let numbered = || input.views.iter().enumerate();
    let numbers: Vec<usize> = numbered().map(|(index, _)| index).filter(|&index| !is_held_out(index)).collect();
    let training: Vec<View> = numbers.iter().map(|&index| input.views[index].clone()).collect();
    let held_out: Vec<View> = match &test {
        Some(test) => test.views.clone(),
        None => numbered().filter(|(index, _)| is_held_out(*index)).map(|(_, view)| view.clone()).collect(),
    };
    if training.len() < 2 {
        let found = format!("{} to fit to and {} held out", training.len(), held_out.len());
        return Err(FitError::Views { found, expected: "at least two to fit to" });
    }
    let cameras = downscaled(&training, settings.downscale)?;
    let mut gallery = Gallery::new(training, cameras, settings.downscale, settings.picture_memory);
    let (mut transparent, mut color, mut weight) = (0, DVec3::ZERO, 0.0);
    gallery.each(|view| {
        transparent += usize::from(view.picture.knows_opacity);
        let (sum, count) = border(view);
        color += sum;
        weight += count;
    })?;
    let knows_opacity = transparent * FEWEST_TRANSPARENT >= gallery.len();
    let in_frame = |corners| TurnedBox::new(corners, turned.unwrap_or(DMat3::IDENTITY));
    let place = scene::find(&mut gallery, &input.points, knows_opacity, settings.bounds.map(in_frame))?;
    let measured = load_some(&held_out, settings)?;
    let preparing = start.elapsed().as_secs_f64();

    let start = Instant::now();
    let backdrop = match settings.background {
        _ if knows_opacity => Backdrop::Random,
        Some(color) => Backdrop::Color(color.as_vec3()),
        None => Backdrop::learned((color / f64::max(weight, 1.0)).as_vec3()),
    };
    let key = key(input, settings);
    let saved = settings.checkpoint.as_deref();
    let mut state = begin(&place, gallery.len(), backdrop, key, settings)?;
    if let Some((low, high)) = settings.crop {
        let (grid, crop) = (&state.model.grid, in_frame((low, high)));
        if !grid.voxels().any(|voxel| crop.overlaps(grid.center(voxel), f64::from(voxel.size) * grid.cell_size())) {
            let found = format!("{low} to {high}");
            return Err(FitError::Setting { setting: "crop", found, expected: "a box with some of what cameras see" });
        }
    }
    if progress.is_stopped() && state.position == Position::default() {
        return Err(FitError::Stopped);
    }
    let depth = settings.depth.unwrap_or_else(|| depth_of(&gallery.cameras(), place.cube));
    let schedule = Schedule::new(settings, depth, !knows_opacity);
    let training = Training { schedule, settings, measured: &measured, progress, key };
    let stages = training.run(&mut gallery, &mut state)?;
    let mut report = FitReport { views: gallery.len(), stages, stopped: progress.is_stopped(), ..FitReport::default() };
    let Checkpoint { model, position, random } = state;
    // Also when training is complete: what follows may fail, and can then be repeated without training again.
    if let Some(path) = saved {
        let written = Checkpoint::write(path, key, &model, &position, &random);
        report.unsaved = written.err().filter(|_| report.stopped).map(|error| error.to_string());
    }
    if matches!(model.backdrop, Backdrop::Learned(_) | Backdrop::Color(_)) {
        report.gains = Some(model.gains.iter().map(|gain| gain.to_array()).collect());
    }

    progress.update(|status| (status.stage, status.fraction) = ("measuring".into(), 1.0));
    (report.fitted_psnr_db, report.suspicious) = suspicious(&model, &mut gallery, &numbers)?;
    let limits = Limits { spacing: 0.7, most: settings.leaves, ..Limits::USUAL };
    let visible = visibility::visible(&model.grid, &gallery.cameras(), limits);
    let mut kept = settings.crop.map(|crop| cropped(&model.grid, &visible, &in_frame(crop)));
    if settings.keep_largest {
        let before = kept.as_ref().unwrap_or(&visible);
        let largest = largest_part(&model.grid, before, 0.2);
        let [part, all] = [&largest, before].map(|voxels| voxels.voxels().count() as f64);
        report.largest_part = Some(part / all);
        kept = Some(largest);
    }
    let whole = to_field(&model.grid, &visible)?;
    let cut = kept.map(|kept| to_field(&model.grid, &kept)).transpose()?;
    let training = start.elapsed().as_secs_f64();

    let start = Instant::now();
    let shown = match (model.backdrop, settings.background) {
        (Backdrop::Random, color) => Backdrop::Color(color.unwrap_or(DVec3::ONE).as_vec3()),
        (other, _) => other,
    };
    // Measuring needs memory, too.
    drop((gallery, measured, model.grid));
    // The pictures show what is cut away, too.
    let (held_out, previews) = measure(&whole, &shown, &held_out, settings, progress)?;
    report.held_out = held_out;
    report.stopped = progress.is_stopped();
    let (mut field, mut cube) = (cut.unwrap_or(whole), place.cube);
    if let Some(turn) = turned {
        let shift = -field.foot().unwrap_or_default();
        field = field.shifted(shift)?;
        cube.low += shift;
        report.from_input = Some(stand::matrix(turn, shift));
        report.up_agreement = agreement;
    }
    report.leaves = field.leaves();
    report.depth = field.depth();
    report.cube = [cube.low.to_array(), (cube.low + cube.size).to_array()];
    report.seconds = Seconds { preparing, training, measuring: start.elapsed().as_secs_f64() };
    Ok(Fitted { field, previews, report })
}

/// Returns where a fit begins: at its checkpoint, if it resumes from one.
fn begin(
    place: &Place,
    views: usize,
    backdrop: Backdrop,
    key: u64,
    settings: &FitSettings,
) -> Result<Checkpoint, FitError> {
    if let Some(path) = settings.checkpoint.as_deref().filter(|path| settings.resume && path.exists()) {
        return Checkpoint::read(path, key, views, backdrop);
    }
    let mut grid = Grid::new(place.cube, settings.basis.functions(), &place.voxels);
    grid.values.iter_mut().step_by(settings.basis.functions()).for_each(|value| value.w = FIRST_THICKNESS);
    grid.copy_thickness();
    let model = Model { grid, backdrop, gains: vec![Vec3::ONE; views] };
    Ok(Checkpoint { model, position: Position::default(), random: Random::new(settings.seed) })
}

/// What the stages of a fit have in common.
struct Training<'a> {
    schedule: Schedule,
    settings: &'a FitSettings,
    /// Some of the views that are held out.
    measured: &'a [TrainView],
    progress: &'a FitProgress,
    /// The one of checkpoints.
    key: u64,
}

impl Training<'_> {
    /// Trains in one stage after another. Returns what each did.
    fn run(&self, gallery: &mut Gallery, state: &mut Checkpoint) -> Result<Vec<StageReport>, FitError> {
        let Checkpoint { model, position, random } = state;
        let saved = self.settings.checkpoint.as_deref();
        // What is left of the time, if it is limited.
        let time = self.settings.time;
        let mut left = time.map(|time| time.as_secs_f64() * (1.0 - self.schedule.shares(position.stage).0));
        let mut saved_at = Instant::now();
        let mut reports = Vec::new();
        while !self.progress.is_stopped() && position.stage < self.schedule.stages.len() {
            let stage = &self.schedule.stages[position.stage];
            let (before, share) = self.schedule.shares(position.stage);
            self.progress
                .update(|status| (status.stage, status.fraction) = (format!("{0}^3", stage.resolution), before));
            let mut splitting = 0.0;
            if model.grid.resolution() < stage.resolution {
                let start = Instant::now();
                model.grid = split(&model.grid, &gallery.cameras(), stage);
                splitting = start.elapsed().as_secs_f64();
                position.seconds += splitting;
            }
            let is_last = Cell::new(position.stage + 1 == self.schedule.stages.len());
            let mut limit = left.map(|left| {
                let is_last = &is_last;
                move |preparing: f64| {
                    let preparing = splitting + preparing;
                    let share = if is_last.get() { 1.0 } else { share / (1.0 - before) };
                    StageTime { preparing, training: ((left - preparing) * share).max(preparing) }
                }
            });
            let mut psnr = None;
            let mut measured_at = -1.0;
            let mut watch = |model: &Model, position: &Position, fraction: f64, random: &Random| {
                // It begins again if the stage gets more time.
                if fraction >= measured_at + 0.1 || fraction < measured_at {
                    measured_at = fraction;
                    psnr = quick_psnr(&model.grid, &model.backdrop, self.measured);
                }
                self.progress.update(|status| {
                    status.stage = format!("{0}^3", stage.resolution);
                    let share = if is_last.get() { 1.0 - before } else { share };
                    status.fraction = before + share * fraction;
                    status.psnr = psnr;
                });
                // The result is worth more than what it could resume from. Whether the last state is saved is reported.
                if let Some(path) = saved.filter(|_| saved_at.elapsed() > SAVE_EVERY) {
                    saved_at = Instant::now();
                    let _ = Checkpoint::write(path, self.key, model, position, random);
                }
            };
            let mut tour = Tour::default();
            loop {
                let limit = limit.as_mut().map(|limit| limit as &mut Limit);
                let tour = &mut tour;
                train(model, gallery, stage, position, tour, random, self.progress, limit, &mut watch)?;
                if is_last.get()
                    || self.progress.is_stopped()
                    || left.is_none()
                    || stage.trained(position) >= LEAST_FOR_FINER
                {
                    break;
                }
                // Voxels of this size are trained on for as long as there is time.
                is_last.set(true);
            }
            left = left.map(|left| left - position.seconds);
            let psnr = quick_psnr(&model.grid, &model.backdrop, self.measured);
            reports.push(StageReport::new(model, position, psnr));
            if !self.progress.is_stopped() {
                let next = if is_last.get() { self.schedule.stages.len() } else { position.stage + 1 };
                *position = Position { stage: next, ..Position::default() };
            }
        }
        Ok(reports)
    }
}

/// Returns a hash of the input and the settings: fits that differ in it cannot resume from each other's checkpoints.
fn key(input: &FitInput, settings: &FitSettings) -> u64 {
    let mut hasher = DefaultHasher::new();
    let mut masks = HashMap::new();
    let mut content = |mask: &Option<PathBuf>| {
        let mask = mask.as_ref()?;
        Some(*masks.entry(mask.clone()).or_insert_with(|| {
            let mut hasher = DefaultHasher::new();
            fs::read(mask).ok().hash(&mut hasher);
            hasher.finish()
        }))
    };
    for view in &input.views {
        // Folders may move, so paths do not count.
        let View { name, mask, ignored, camera, .. } = view;
        let ViewCamera { width, height, lens, rotation, position, .. } = camera;
        [mask, ignored].map(&mut content).hash(&mut hasher);
        format!("{name:?} {width} {height} {lens:?} {rotation:?} {position:?}").hash(&mut hasher);
    }
    input.points.iter().for_each(|point| point.to_array().map(f64::to_bits).hash(&mut hasher));
    let FitSettings { leaves, depth, basis, downscale, bounds, background, hold_out, stand, .. } = settings;
    format!("{leaves} {depth:?} {basis:?} {downscale} {bounds:?} {background:?} {hold_out:?} {stand}")
        .hash(&mut hasher);
    hasher.finish()
}

/// Returns the number of levels of a cube at which the finest cells are about half a pixel wide in its middle.
fn depth_of(cameras: &[&ViewCamera], cube: Cube) -> u32 {
    let pixels = |camera: &&ViewCamera| cube.size * camera.lens.focal.x / cube.distance(camera.position);
    let mean = cameras.iter().map(pixels).sum::<f64>() / cameras.len().max(1) as f64;
    ((2.0 * mean).log2().round() as u32).clamp(7, 9)
}

/// Returns the cameras for the downscaled pictures.
fn downscaled(views: &[View], downscale: u32) -> Result<Vec<ViewCamera>, FitError> {
    let mut maker = CameraMaker::default();
    let small = |view: &View| {
        view.camera.downscaled_by(&mut maker, downscale).map_err(|point| {
            FitError::found(&view.picture, "lens", format!("no direction at {point}"), "a lens that covers the picture")
        })
    };
    views.iter().map(small).collect()
}

fn load(view: &View, number: usize, settings: &FitSettings) -> Result<TrainView, FitError> {
    let picture = Picture::read(&view.picture, view.mask.as_deref(), settings.downscale)?;
    let camera = downscaled(std::slice::from_ref(view), settings.downscale)?.remove(0);
    Ok(TrainView { number, camera, picture: Arc::new(picture) })
}

/// Loads some views to measure while training. Reads all, so that a damaged one is found before training.
fn load_some(views: &[View], settings: &FitSettings) -> Result<Vec<TrainView>, FitError> {
    let every = views.len().div_ceil(MOST_PREVIEWS).max(1);
    let mut some = Vec::new();
    for (index, view) in views.iter().enumerate() {
        let loaded = load(view, index, settings)?;
        if index.is_multiple_of(every) {
            some.push(loaded);
        }
    }
    Ok(some)
}

/// Returns the sum and the number of the known colors on the border of a picture.
fn border(TrainView { picture, camera, .. }: &TrainView) -> (DVec3, f64) {
    let (width, height) = (picture.width, picture.height);
    let on_border = |index: u32| {
        let (x, y) = (index % width, index / width);
        (x == 0 || y == 0 || x + 1 == width || y + 1 == height) && camera.knows(x, y)
    };
    let pixels = (0..).zip(&picture.pixels).filter(|(index, _)| on_border(*index));
    pixels.fold((DVec3::ZERO, 0.0), |(sum, count), (_, [r, g, b, _])| {
        (sum + DVec3::new((*r).into(), (*g).into(), (*b).into()) / 255.0, count + 1.0)
    })
}

/// Compares the field with all held-out views. Ends early if `progress` is stopped meanwhile, but not if training was:
/// the result could not be compared with others.
fn measure(
    field: &PlenOctree,
    backdrop: &Backdrop,
    views: &[View],
    settings: &FitSettings,
    progress: &FitProgress,
) -> Result<(Option<HeldOut>, Vec<Comparison>), FitError> {
    if views.is_empty() {
        return Ok((None, Vec::new()));
    }
    let every = views.len().div_ceil(MOST_PREVIEWS).max(1);
    let (mut held_out, mut previews) = (HeldOut::default(), Vec::new());
    let goes_on = progress.is_stopped();
    for (index, view) in views.iter().enumerate() {
        if index > 0 && progress.is_stopped() && !goes_on {
            break;
        }
        let loaded = load(view, index, settings)?;
        let (compared, report) = compare(field, backdrop, &view.name, &loaded.camera, &loaded.picture);
        held_out.views.push(report);
        if index.is_multiple_of(every) {
            previews.push(compared);
        }
    }
    let count = held_out.views.len() as f64;
    let mean = |value: fn(&ViewReport) -> f64| held_out.views.iter().map(value).sum::<f64>() / count;
    (held_out.psnr_db, held_out.ssim) = (mean(|view| view.psnr_db), mean(|view| view.ssim));
    held_out.aligned_psnr_db = mean(|view| view.aligned_psnr_db);
    Ok((Some(held_out), previews))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::input::Distortion;

    /// Everything about a camera, a mask and the points tells inputs apart. Where the files are does not.
    #[test]
    fn keys_tell_inputs_apart() {
        let settings = FitSettings::default();
        let view = |change: &dyn Fn(&mut ViewCamera)| {
            let mut camera = ViewCamera::centered([40; 2], 50.0, DMat3::IDENTITY, DVec3::ZERO);
            change(&mut camera);
            View { name: "a".into(), picture: "a.png".into(), mask: None, ignored: None, camera }
        };
        let input = |view| FitInput { views: vec![view], ..FitInput::default() };
        let same = || input(view(&|_| ()));
        let moved = input(View { picture: "elsewhere/a.png".into(), ..view(&|_| ()) });
        assert_eq!([key(&same(), &settings), key(&moved, &settings)], [key(&same(), &settings); 2]);
        let folder = tempfile::tempdir().unwrap();
        let [mask, other] = ["mask.png", "other.png"].map(|name| {
            let path = folder.path().join(name);
            fs::write(&path, name).unwrap();
            Some(path)
        });
        let others = [
            input(view(&|camera| camera.width = 41)),
            input(view(&|camera| camera.height = 41)),
            input(view(&|camera| camera.lens.focal.y += 1e-9)),
            input(view(&|camera| camera.lens.center.x += 1e-9)),
            input(view(&|camera| camera.lens.distortion = Distortion::Fisheye([0.1, 0.0, 0.0, 0.0]))),
            input(view(&|camera| camera.rotation = DMat3::from_rotation_x(1e-6))),
            input(view(&|camera| camera.position.z = 1e-9)),
            input(View { mask: mask.clone(), ..view(&|_| ()) }),
            input(View { mask: other, ..view(&|_| ()) }),
            input(View { ignored: mask, ..view(&|_| ()) }),
            FitInput { points: vec![DVec3::ONE], ..same() },
        ];
        let mut keys: Vec<u64> = others.iter().chain([&same()]).map(|input| key(input, &settings)).collect();
        keys.sort_unstable();
        keys.dedup();
        assert_eq!(keys.len(), others.len() + 1);
    }
}
