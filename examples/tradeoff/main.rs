//! Measures what every knob of quality costs in accuracy and saves in time, on any field.
//!
//! ```sh
//! cargo run --release --example tradeoff -- field.npz --cameras transforms.json --out out
//! ```

mod arguments;
mod measure;
mod plot;
mod report;
#[path = "../common/size.rs"]
mod size;
mod stage;
mod variants;

use std::{f64::consts::TAU, fs, process::ExitCode};

use bevy_plenoctree::{
    ExtractionSettings, PlenOctree,
    camera::{PinholeCamera, read_transforms},
    field::LoadSettings,
    palette,
};
use clap::Parser;

use arguments::Arguments;

type Result<T, E = Box<dyn std::error::Error>> = std::result::Result<T, E>;

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

fn run(arguments: &Arguments) -> Result<()> {
    let field = PlenOctree::read(arguments.field(), &LoadSettings::default())?;
    let cameras = cameras(&field, arguments)?;
    let exact = palette::extract(&field, &ExtractionSettings::default(), &Default::default())?.palette;
    let (mut rows, noise) = measure::rendering(&field, &exact, &cameras, arguments.rounds)?;
    rows.extend(measure::extraction(&field, &exact, arguments.rounds)?);

    let out = &arguments.out;
    let written = |name: &str, text: String| {
        let path = out.join(name);
        fs::write(&path, text).map_err(|error| format!("{}: {error}", path.display()))
    };
    fs::create_dir_all(out).map_err(|error| format!("{}: {error}", out.display()))?;
    written("tradeoff.csv", report::csv(&rows))?;
    written("tradeoff.md", report::markdown(&rows, noise))?;
    written("psnr.svg", plot::svg(&rows, "PSNR, dB", true, |row| row.psnr_db))?;
    written(
        "labels.svg",
        plot::svg(&rows, "label changes, %", false, |row| row.label_changes.map(|share| 100.0 * share)),
    )?;
    println!("{}", report::markdown(&rows, noise));
    println!("{}", out.display());
    Ok(())
}

/// A few views, evenly out of those that there are.
fn cameras(field: &PlenOctree, arguments: &Arguments) -> Result<Vec<PinholeCamera>> {
    let (width, height) = arguments.size;
    let count = arguments.views as usize;
    let all = match &arguments.cameras {
        Some(file) => read_transforms(file, Some(arguments.size))?,
        None => (0..count)
            .map(|view| view as f64 / count as f64 * TAU)
            .filter_map(|azimuth| PinholeCamera::around(field, width, height, azimuth, 0.4))
            .collect(),
    };
    if all.is_empty() {
        return Err(format!("{}: the field is empty", arguments.field().display()).into());
    }
    Ok(all.iter().step_by(all.len().div_ceil(count).max(1)).copied().collect())
}
