//! `tradeoff`: measures what every quality setting costs in accuracy and saves in time, on any field.

mod arguments;
mod measure;
mod plot;
mod report;
mod stage;
mod variants;

pub use arguments::Arguments;

use std::f64::consts::TAU;

use plenoctree::{PlenOctree, camera::PinholeCamera, palette::ExtractionSettings};
use plenoctree_fit::read_transforms;

use crate::{console, extraction, field, files, result::Result, turntable};

/// Measures everything and writes the tables and the plots.
pub fn run(arguments: &Arguments) -> Result {
    let field = field::load(&arguments.field(), false)?;
    let cameras = cameras(&field, arguments)?;
    let out = &arguments.out;
    files::create_folder(out)?;
    let exact = extraction::cpu::extract(&field, &ExtractionSettings::default(), false)?.extraction.palette;
    let (mut rows, noise) = measure::rendering(&field, &exact, &cameras, arguments.rounds)?;
    rows.extend(measure::extraction(&field, &exact, arguments.rounds)?);

    let write = |name: &str, text: &str| files::write_text(&out.join(name), text);
    write("tradeoff.csv", &report::csv(&rows))?;
    write("tradeoff.md", &report::markdown(&rows, noise))?;
    write("psnr.svg", &plot::svg(&rows, "PSNR, dB", true, |row| row.psnr_db))?;
    let percent = |row: &measure::Row| row.label_changes.map(|share| 100.0 * share);
    write("labels.svg", &plot::svg(&rows, "label changes, %", false, percent))?;
    console::say!("{}", report::markdown(&rows, noise));
    console::say!("{}", out.display());
    Ok(())
}

/// The elevation of the turntable's cameras above the horizon, in radians.
const ELEVATION: f64 = 0.4;

/// Returns the requested number of views, evenly chosen from all cameras.
fn cameras(field: &PlenOctree, arguments: &Arguments) -> Result<Vec<PinholeCamera>> {
    let count = arguments.views as usize;
    let azimuths = (0..count).map(|view| view as f64 / count as f64 * TAU);
    let all = match &arguments.cameras {
        Some(file) => read_transforms(file, Some(arguments.size))?,
        None => turntable::around(field, arguments.size, azimuths, ELEVATION).unwrap_or_default(),
    };
    if all.is_empty() {
        return Err(format!("{}: the field is empty", arguments.field().display()).into());
    }
    Ok(all.iter().step_by(all.len().div_ceil(count).max(1)).copied().collect())
}
