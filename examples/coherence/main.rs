//! How coherent an animation is with one palette for the field, against one palette for each of its frames: figure 7 of
//! the paper.
//!
//! ```sh
//! cargo run --release --example coherence -- [FIELD] [--out DIR] [--frames N] [--size WxH] [--quiet]
//! ```
//!
//! The camera turns by 90 degrees around the field. Every frame is rendered plainly, posterized with the field's palette,
//! and posterized with a palette of its own, the simplified convex hull of its pixels (Tan et al. 2016); and both again
//! recolored, every color of the palette by one of the opposite hue. `coherence.csv` holds how much neighboring frames
//! differ, and `coherence.png` plots it:
//!
//! | column | |
//! |---|---|
//! | `frame` | the second frame of the pair, counted from 0 |
//! | `plain` | mean absolute difference of encoded sRGB, in [0, 1], over all pixels and channels, of the plain frames |
//! | `field`, `per_frame` | the same of the frames that were posterized with the field's palette, and with their own |
//! | `field_recolored`, `per_frame_recolored` | the same of those that were also recolored |

mod arguments;
mod plot;
mod series;
#[path = "../common/size.rs"]
mod size;
mod stage;
#[path = "../common/text.rs"]
mod text;
mod turn;

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
    time::Duration,
};

use bevy_plenoctree::{
    ExtractionSettings, Palette, PlenOctree,
    field::LoadSettings,
    palette::{Progress, extract},
};
use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};

use arguments::Arguments;
use series::Series;
use stage::Stage;

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

type Result<T, E = Box<dyn std::error::Error>> = std::result::Result<T, E>;

fn run(arguments: &Arguments) -> Result<()> {
    let path = arguments.field.clone().unwrap_or_else(default_prop);
    let (field, palette) = load(&path, arguments.quiet)?;
    let cameras = turn::quarter(&field, arguments.size, arguments.frames as usize)
        .ok_or_else(|| format!("{}: the field is empty", path.display()))?;
    let out = &arguments.out;
    std::fs::create_dir_all(out).map_err(|error| format!("{}: {error}", out.display()))?;

    let mut stage =
        Stage::new(field, palette, arguments.size).map_err(|error| format!("{}: {error}", path.display()))?;
    let mut series = Series::default();
    let progress = progress(arguments.quiet, "rendering", cameras.len() as u64);
    for (frame, camera) in cameras.iter().enumerate() {
        series.push(stage.shoot(camera).map_err(|error| format!("frame {frame}: {error}"))?);
        progress.inc(1);
    }
    progress.finish_and_clear();

    series.write(&out.join("coherence.csv"))?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let picture = out.join("coherence.png");
    plot::draw(&series, &name).save(&picture).map_err(|error| format!("{}: {error}", picture.display()))?;
    if !arguments.quiet {
        print!("{}", series.summary());
        println!("{} frames of {} in {}", cameras.len(), path.display(), out.display());
    }
    Ok(())
}

/// The prop of our own that is shown when no field is named.
fn default_prop() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("assets/toadstool.npz")
}

/// The field and the palette that the paper's method extracts from it.
fn load(path: &Path, quiet: bool) -> Result<(PlenOctree, Palette)> {
    let spinner = progress(quiet, "extracting the palette", 0);
    spinner.enable_steady_tick(Duration::from_millis(100));
    let field = PlenOctree::read(path, &LoadSettings::default())?;
    let extraction = extract(&field, &ExtractionSettings::default(), &Progress::default())
        .map_err(|error| format!("{}: {error}", path.display()))?;
    spinner.finish_and_clear();
    Ok((field, extraction.palette))
}

/// A bar, or a spinner if there is no length.
fn progress(quiet: bool, message: &'static str, length: u64) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    let template = if length == 0 { "{spinner} {msg}" } else { "{msg:12} [{bar:40}] {pos}/{len} {eta}" };
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(length).with_style(style).with_message(message)
}
