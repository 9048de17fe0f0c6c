//! `convert`: converts a capture of Gaussian splats to a field.

mod arguments;
mod cameras;
mod measure;
mod quality;

pub use arguments::Arguments;

use std::time::{Duration, Instant};

use glam::DVec3;
use plenoctree::{PlenOctree, camera::PinholeCamera};
use plenoctree_fit::{
    FitError, RefineSettings, Refined, Shot, refine,
    splat::{SPLAT_BLUR, SplatImage, Splats, Subject, SubjectSettings, VoxelSettings, render_splats, voxelize},
};
use serde_json::{Value, json};

use self::measure::{Measured, Pictures, Standard};
use crate::{
    capture, console,
    fit::output,
    number::{counted, significant},
    progress,
    result::Result,
    training::{Interruption, use_threads},
};

/// The least PSNR where views of the whole show something, in decibels, that a field has without a warning.
const LEAST_PSNR: f64 = 16.0;
/// The most that refining may lose in whole pictures from nearby, in decibels.
const MOST_LOSS: f64 = 0.1;
/// The most Gaussians that rays meet on average, so that pictures take seconds. In usual captures, they meet hundreds at
/// most.
const MOST_OVERLAP: f64 = 4000.0;
/// The variance of a cell, in square cells.
const CELL: f64 = 1.0 / 12.0;
/// The least and the greatest blur of a field, in finest cells.
const BLURS: [f64; 2] = [0.25, 0.5];

/// Converts the capture, extracts the palette, and writes both with views and a report.
pub fn run(arguments: &Arguments) -> Result {
    let path = &arguments.capture;
    output::check(&arguments.out, &[path], &arguments.extraction)?;
    use_threads(arguments.threads)?;
    let interruption = Interruption::new(output::cleaning_up(&arguments.out))?;
    let start = Instant::now();
    let (Subject { splats, low, high, turn }, all) = read(arguments)?;
    let reading = start.elapsed();

    let start = Instant::now();
    let (side, size) = ((high - low).max_element(), arguments.picture_size);
    let near = arguments.near.unwrap_or(0.5 * side);
    let between = (near * cameras::far(low, high)).sqrt();
    let pictures = |cameras: Vec<PinholeCamera>| {
        let images = photograph(&splats, &cameras, "measuring", None, |_, image| image);
        Pictures { cameras, images }
    };
    let standard = Standard {
        whole: pictures(cameras::whole(low, high, size)),
        between: pictures(cameras::measuring(low, high, between, size)),
        near: pictures(cameras::measuring(low, high, near, size)),
    };
    let mut measuring = start.elapsed();

    let start = Instant::now();
    let spinner = progress::spinner("voxelizing", false);
    let mut field = voxelized(&splats, [low, high], [near, between], &standard.near, arguments)?;
    spinner.finish_and_clear();
    interruption.keep_result();
    let voxelizing = start.elapsed();

    let start = Instant::now();
    let mut measured = standard.measure(&field);
    let voxelized = measured.json(&field);
    let leaves = counted(field.leaves(), "leaf", "leaves");
    console::say!("voxelized: {leaves}, {measured} in {:.1} s", voxelizing.as_secs_f64());
    measuring += start.elapsed();
    let (mut refined, mut refining) = (None, Duration::ZERO);
    if !arguments.no_refine {
        let start = Instant::now();
        let shot = |camera: &PinholeCamera, image: SplatImage| Shot::new(camera, &image.pixels);
        let cameras = cameras::refining(low, high, near, size);
        let shots = photograph(&splats, &cameras, "rendering", Some(&interruption), shot);
        if interruption.is_requested() {
            console::complain!("warning: stopped before refining: the field is as voxelized");
        } else {
            drop(splats);
            let held_out = standard.near.shots();
            let settings = RefineSettings {
                effort: arguments.effort,
                time: arguments.minutes.map(|minutes| Duration::from_secs_f64(60.0 * minutes)),
                seed: arguments.seed,
            };
            let (better, before) = interruption.watched(path, move |progress| {
                match refine(&field, &shots, &held_out, &settings, progress) {
                    // It is too small to be in view.
                    Err(FitError::Empty) => Ok((None, field)),
                    refined => Ok((Some(refined?), field)),
                }
            })?;
            field = before;
            refining = start.elapsed();
            let start = Instant::now();
            match better {
                Some(better) => {
                    let report;
                    (field, measured, report) =
                        choose((field, measured), better, refining, &standard, interruption.is_requested())?;
                    refined = Some(report);
                }
                None => console::complain!("warning: refining sees nothing of the field: it is as voxelized"),
            }
            measuring += start.elapsed();
        }
    }
    let shown = measured.whole.shown;
    if shown.psnr < LEAST_PSNR {
        console::complain!(
            "warning: {}: the field hardly looks like the capture, with {:.2} dB in the {:.2}% of views of the whole \
             that show something; if much of the box is empty, or of no use, --crop or --keep-largest leave more of \
             the field for the rest",
            path.display(),
            shown.psnr,
            100.0 * shown.share
        );
    }
    let stopped = interruption.is_requested();
    let mut shift = DVec3::ZERO;
    if arguments.stand {
        shift = -field.foot().unwrap_or_default();
        field = field.shifted(shift).map_err(|error| format!("{}: {error}", path.display()))?;
    }

    let seconds = |duration: Duration| (1e3 * duration.as_secs_f64()).round() / 1e3;
    let row = |at: usize| [turn.x_axis[at], turn.y_axis[at], turn.z_axis[at], shift[at]];
    let report = json!({
        "gaussians": all,
        "depth": field.depth(),
        "near": near,
        "box": [low.to_array(), high.to_array()],
        "from_capture": [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]],
        "voxelized": voxelized,
        "refined": refined,
        "stopped": stopped,
        "seconds": {
            "reading": seconds(reading),
            "voxelizing": seconds(voxelizing),
            "refining": seconds(refining),
            "measuring": seconds(measuring),
        },
    });
    let (file, written) =
        output::write(&arguments.out, &field, &arguments.extraction, &measured.whole.previews, &report)?;
    console::say!("{}: {}", file.display(), counted(written, "leaf", "leaves"));
    Ok(())
}

/// Reads the capture. Returns what is converted of it, and the number of all Gaussians.
fn read(arguments: &Arguments) -> Result<(Subject, usize)> {
    let path = &arguments.capture;
    let splats = capture::load(path, arguments.reading, false)?;
    let all = splats.len();
    if let (true, None, Some(up)) = (arguments.stand, arguments.up, splats.up()) {
        console::say!("{}: {up} is up, as the file says; --up chooses another direction", path.display());
    }
    let settings = SubjectSettings {
        crop: arguments.crop,
        keep_largest: arguments.keep_largest,
        up: arguments.stand.then(|| arguments.up.or(splats.up()).unwrap_or_default()),
    };
    let mut subject = splats.subject(&settings).map_err(|error| format!("{}: {error}", path.display()))?;
    let Subject { splats, low, high, .. } = &subject;
    let corner = |corner: &DVec3| significant(corner.to_array()).join(", ");
    console::say!(
        "{}: {}, {} of them in the box from [{}] to [{}]",
        path.display(),
        counted(all, "Gaussian", "Gaussians"),
        splats.len(),
        corner(low),
        corner(high)
    );
    let overlap = splats.overlap(*low, *high);
    let every = (overlap / MOST_OVERLAP).ceil().max(1.0) as usize;
    if every > 1 {
        console::complain!(
            "warning: {}: rays meet about {overlap:.0} Gaussians, of which pictures would take minutes; one of every \
             {every} is used",
            path.display()
        );
        subject.splats = subject.splats.thinned(every);
    }
    Ok((subject, all))
}

/// Converts the Gaussians to a field that looks right from nearby, and from as far as halfway.
fn voxelized(
    splats: &Splats,
    [low, high]: [DVec3; 2],
    [near, between]: [f64; 2],
    from_nearby: &Pictures,
    arguments: &Arguments,
) -> Result<PlenOctree> {
    let cells = (high - low).max_element() / cameras::pixel(near, arguments.picture_size);
    let depth = arguments.depth.unwrap_or_else(|| cells.log2().clamp(6.0, 10.0).round() as u32);
    // In all, as much as splats are.
    let pixel = f64::from(depth).exp2() / cells;
    let blur = (SPLAT_BLUR * pixel * pixel - CELL).max(0.0).sqrt().clamp(BLURS[0], BLURS[1]);
    let settings = VoxelSettings {
        depth,
        leaves: arguments.leaves as usize,
        bounds: Some((low, high)),
        blur,
        views: cameras::looking(low, high, near, between),
    };
    let field = match arguments.quality {
        Some(quality) => quality::field(splats, settings, quality, from_nearby),
        None => voxelize(splats, &settings),
    };
    field.map_err(|error| format!("{}: {error}", arguments.capture.display()).into())
}

/// Says what refining gained, and returns the field that is better, its measures and the report.
fn choose(
    (field, measured): (PlenOctree, Measured),
    Refined { field: better, before_psnr_db, rounds, kept }: Refined,
    refining: Duration,
    standard: &Standard,
    is_stopped: bool,
) -> Result<(PlenOctree, Measured, Value)> {
    let after = standard.measure(&better);
    let gains: Vec<String> = rounds.iter().filter_map(|round| Some(format!("{:+.2}", round.gain_db?))).collect();
    let leaves = counted(better.leaves(), "leaf", "leaves");
    console::say!("refined: {leaves}, {after} in {:.0} s", refining.as_secs_f64());
    let [whole, between, near] = after.gains(&measured);
    let is_worse = near < -MOST_LOSS;
    let kept = if is_worse { 0 } else { kept };
    console::say!("{}: {} dB, {kept} kept", counted(rounds.len(), "round", "rounds"), gains.join(", "));
    console::say!("gained over white: {whole:+.2} dB, from halfway {between:+.2} dB, from nearby {near:+.2} dB");
    let (field, measured) = if kept == 0 {
        let reason = match () {
            () if is_worse => format!("refining loses {:.2} dB from nearby", -near),
            () if is_stopped => "stopped before refining paid off".into(),
            () => "refining gains nothing".into(),
        };
        console::complain!("warning: {reason}: the field is as voxelized");
        (field, measured)
    } else {
        (better, after)
    };
    let mut report = measured.json(&field);
    report["before_psnr_db"] = before_psnr_db.into();
    report["rounds"] = serde_json::to_value(&rounds)?;
    report["kept"] = kept.into();
    Ok((field, measured, report))
}

/// Renders the capture, until it is interrupted, and returns what `keep` makes of the images.
fn photograph<T>(
    splats: &Splats,
    cameras: &[PinholeCamera],
    message: &'static str,
    interruption: Option<&Interruption>,
    keep: impl Fn(&PinholeCamera, SplatImage) -> T,
) -> Vec<T> {
    let bar = progress::bar(message, cameras.len() as u64, false);
    let goes_on = |_: &&PinholeCamera| interruption.is_none_or(|interruption| !interruption.is_requested());
    let images = cameras.iter().take_while(goes_on).map(|camera| {
        bar.inc(1);
        keep(camera, render_splats(splats, camera))
    });
    let images = images.collect();
    bar.finish_and_clear();
    images
}
