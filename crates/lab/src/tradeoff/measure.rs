//! Measures times, alternating between variants, and differences from the exact frame.

use std::time::Instant;

use bevy_plenoctree::{EdgeSmoothing, Posterize};
use glam::DVec3;
use image::RgbaImage;
use plenoctree::{
    PlenOctree,
    camera::PinholeCamera,
    palette::{self, Palette},
    reference::{self, Rendering},
};
use plenoctree_cli::{hex, progress, result::Result, turntable::turned};
use plenoctree_fit::ssim;

use super::{
    stage::{Change, Stage},
    variants::{self, Variant},
};

/// The cost and the savings of one value of a setting. Measurements that do not apply are `None`.
pub struct Row {
    /// The setting.
    pub setting: &'static str,
    /// Its value.
    pub value: String,
    /// The median time of a frame, or of an extraction.
    pub milliseconds: f64,
    /// That time, relative to the exact one.
    pub ratio_to_exact: f64,
    /// The PSNR of frames as trained, against float64.
    pub psnr_db: Option<f64>,
    /// The structural similarity of frames as trained, against float64.
    pub ssim: Option<f64>,
    /// The fraction of the prop's pixels whose label changes.
    pub label_changes: Option<f64>,
    /// The mean difference of a channel, 0 to 1, between posterized frames half a degree apart, over the prop's pixels.
    pub flicker: Option<f64>,
    /// The largest difference of a channel of the palette, 0 to 1.
    pub palette_error: Option<f64>,
}

impl Row {
    /// Whether the row is on the Pareto front of time and PSNR.
    pub fn is_best(&self, rows: &[Self]) -> bool {
        let Some(psnr) = self.psnr_db else { return false };
        !rows.iter().any(|other| {
            let Some(theirs) = other.psnr_db else { return false };
            let (faster, nearer) = (other.ratio_to_exact <= self.ratio_to_exact, theirs >= psnr);
            faster && nearer && (other.ratio_to_exact < self.ratio_to_exact || theirs > psnr)
        })
    }
}

/// The PSNR of frames without a difference, in dB, because plots and tables cannot show infinity.
const MOST_PSNR: f64 = 120.0;

/// Half a degree, in radians.
const TURN: f64 = std::f64::consts::PI / 360.0;

/// Measures rendering. Returns the rows, and how much the ratio of two series of exact frames differs from 1.
pub fn rendering(
    field: &PlenOctree,
    palette: &Palette,
    cameras: &[PinholeCamera],
    rounds: u32,
) -> Result<(Vec<Row>, f64)> {
    let size = (cameras[0].width, cameras[0].height);
    let mut stage = Stage::new(field, palette, size)?;
    let variants = variants::rendering();
    let references = render_references(field, cameras);
    let over_white = |rendering: &Rendering| -> Vec<DVec3> {
        rendering.over(DVec3::ONE).into_iter().map(|color| color.clamp(DVec3::ZERO, DVec3::ONE)).collect()
    };
    let truths: Vec<_> = references.iter().map(over_white).collect();
    // With hard edges, the color of a pixel tells its label.
    let hard = Posterize { softness: 0.0, edges: EdgeSmoothing::Off, ..Posterize::paper() };
    let colors: Vec<_> = palette.colors.iter().map(|color| DVec3::from(*color)).collect();
    let labels = reference::labels(&colors, hard.blend_steps);

    let bar = progress::bar("comparing", variants.len() as u64, false);
    let mut exact = Vec::new();
    let mut rows = Vec::new();
    for variant in &variants {
        let (mut squares, mut values, mut likeness) = (0.0, 0usize, 0.0);
        let (mut changed, mut flicker, mut owned) = (0usize, 0.0, 0usize);
        for (view, camera) in cameras.iter().enumerate() {
            stage.set(variant, None);
            let frame: Vec<_> = pixels(&stage.capture(camera)?).collect();
            squares += frame.iter().zip(&truths[view]).map(|(a, b)| a.distance_squared(*b)).sum::<f64>();
            likeness += ssim(&frame, &truths[view], size.0 as usize);
            values += 3 * truths[view].len();
            stage.set(variant, Some(hard));
            let here: Vec<_> = pixels(&stage.capture(camera)?).map(|color| nearest(color, &labels)).collect();
            stage.set(variant, Some(Posterize::paper()));
            let (before, after) = (stage.capture(camera)?, stage.capture(&turned(field, camera, TURN))?);
            if variant.setting == "exact" {
                exact.push(here.clone());
            }
            for (index, (a, b)) in pixels(&before).zip(pixels(&after)).enumerate() {
                if references[view].opacity[index] >= f64::from(hard.min_opacity) {
                    owned += 1;
                    changed += usize::from(here[index] != exact[view][index]);
                    flicker += (a - b).abs().element_sum() / 3.0;
                }
            }
        }
        let owned = owned.max(1) as f64;
        rows.push(Row {
            setting: variant.setting,
            value: variant.value.clone(),
            milliseconds: 0.0,
            ratio_to_exact: 0.0,
            psnr_db: Some((-10.0 * (squares / values as f64).log10()).min(MOST_PSNR)),
            ssim: Some(likeness / cameras.len() as f64),
            label_changes: Some(changed as f64 / owned),
            flicker: Some(flicker / owned),
            palette_error: None,
        });
        bar.inc(1);
    }
    bar.finish_and_clear();

    let times = time_variants(&mut stage, &variants, cameras, rounds)?;
    let noise = median(times[0].iter().map(|(exact, own)| (own / exact - 1.0).abs()));
    for (row, times) in rows.iter_mut().zip(times) {
        row.milliseconds = 1e3 * median(times.iter().map(|(_, own)| own / cameras.len() as f64));
        row.ratio_to_exact =
            if row.setting == "exact" { 1.0 } else { median(times.iter().map(|(exact, own)| own / exact)) };
    }
    rows.extend(time_changes(&mut stage, &variants[0], cameras, rounds)?);
    Ok((rows, noise))
}

/// Measures exact frames in which something other than the camera changes.
fn time_changes(stage: &mut Stage, exact: &Variant, cameras: &[PinholeCamera], rounds: u32) -> Result<Vec<Row>> {
    stage.set(exact, Some(Posterize::paper()));
    let changes = [(Change::Palette, "only the palette"), (Change::Nothing, "nothing")];
    let mut times = changes.map(|_| Vec::new());
    for _ in 0..rounds {
        for camera in cameras {
            let moved = stage.time(camera, Change::Camera)?;
            // What has changed is drawn, and copied in the next frame.
            (0..2).try_for_each(|_| stage.time(camera, Change::Nothing).map(|_| ()))?;
            for ((change, _), times) in changes.iter().zip(&mut times) {
                times.push((moved, stage.time(camera, *change)?));
            }
        }
    }
    let rows = changes.into_iter().zip(times).map(|((_, value), times)| Row {
        setting: "changes",
        value: value.into(),
        milliseconds: 1e3 * median(times.iter().map(|(_, own)| *own)),
        ratio_to_exact: median(times.iter().map(|(moved, own)| own / moved)),
        psnr_db: None,
        ssim: None,
        label_changes: None,
        flicker: None,
        palette_error: None,
    });
    Ok(rows.collect())
}

/// Renders the views in float64.
fn render_references(field: &PlenOctree, cameras: &[PinholeCamera]) -> Vec<Rendering> {
    let bar = progress::bar("reference", cameras.len() as u64, false);
    let render = |camera: &PinholeCamera| {
        let rendering = reference::render(field, camera);
        bar.inc(1);
        rendering
    };
    let references = cameras.iter().map(render).collect();
    bar.finish_and_clear();
    references
}

/// Returns, for every variant and round, how many seconds all views take with the exact settings and with its own.
/// Machines are noisy, so each variant is timed right after the exact one, in every round.
fn time_variants(
    stage: &mut Stage,
    variants: &[Variant],
    cameras: &[PinholeCamera],
    rounds: u32,
) -> Result<Vec<Vec<(f64, f64)>>> {
    let bar = progress::bar("timing", u64::from(rounds) * variants.len() as u64, false);
    let mut times = vec![Vec::new(); variants.len()];
    for _ in 0..rounds {
        for (variant, times) in variants.iter().zip(&mut times) {
            let mut total = |variant| -> Result<f64> {
                stage.set(variant, Some(Posterize::paper()));
                stage.capture(&cameras[0])?;
                cameras.iter().map(|camera| stage.time(camera, Change::Camera)).sum()
            };
            times.push((total(&variants[0])?, total(variant)?));
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    Ok(times)
}

/// Measures extraction.
pub fn extraction(field: &PlenOctree, exact: &Palette, rounds: u32) -> Result<Vec<Row>> {
    let all = variants::extraction();
    let mut times = vec![Vec::new(); all.len()];
    let mut errors = vec![0.0; all.len()];
    let bar = progress::bar("extracting", u64::from(rounds) * all.len() as u64, false);
    for _ in 0..rounds {
        let mut base = 1.0;
        for (index, (_, _, settings)) in all.iter().enumerate() {
            let start = Instant::now();
            let palette = palette::extract(field, settings, &Default::default())?.palette;
            let seconds = start.elapsed().as_secs_f64();
            if index == 0 {
                base = seconds;
            }
            times[index].push((base, seconds));
            errors[index] = difference(&palette, exact);
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    let rows = all.into_iter().zip(times).zip(errors).map(|(((setting, value, _), times), error)| Row {
        setting,
        value,
        milliseconds: 1e3 * median(times.iter().map(|(_, own)| *own)),
        ratio_to_exact: median(times.iter().map(|(exact, own)| own / exact)),
        psnr_db: None,
        ssim: None,
        label_changes: None,
        flicker: None,
        palette_error: Some(error),
    });
    Ok(rows.collect())
}

fn pixels(image: &RgbaImage) -> impl Iterator<Item = DVec3> {
    image.pixels().map(|pixel| {
        let [r, g, b, _] = hex::unit(pixel.0);
        DVec3::new(r, g, b)
    })
}

fn nearest(color: DVec3, labels: &[DVec3]) -> usize {
    let distance = |label: &usize| color.distance_squared(labels[*label]);
    (0..labels.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0)
}

/// Returns the largest difference of a channel between a palette's colors and the nearest exact ones.
fn difference(palette: &Palette, exact: &Palette) -> f64 {
    let colors = |palette: &Palette| palette.colors.iter().map(|color| DVec3::from(*color)).collect::<Vec<_>>();
    let (own, exact) = (colors(palette), colors(exact));
    let from = |color: &DVec3| exact[nearest(*color, &exact)];
    own.iter().map(|color| (*color - from(color)).abs().max_element()).fold(0.0, f64::max)
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<_> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
