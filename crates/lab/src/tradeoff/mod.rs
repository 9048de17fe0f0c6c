//! `tradeoff`: measures what every quality setting costs in accuracy and saves in time, on any field.

mod arguments;
mod measure;
mod plot;
mod report;
mod stage;
mod variants;

pub use arguments::Arguments;

use std::f64::consts::TAU;

use crate::report::Folder;
use plenoctree::{
    PlenOctree,
    camera::PinholeCamera,
    palette::{ExtractionSettings, PaletteMethod},
};
use plenoctree_cli::{console, extraction, field, result::Result, transforms, turntable};

/// Measures everything and writes the tables and the plots.
pub fn run(arguments: &Arguments) -> Result {
    let field = field::load(&arguments.field(), false)?;
    let cameras = cameras(&field, arguments)?;
    let folder = Folder::create(&arguments.out)?;
    let fitted = ExtractionSettings { method: PaletteMethod::Fitted, ..ExtractionSettings::default() };
    let exact = extraction::cpu::extract(&field, &fitted, false)?.extraction.palette;
    let (mut rows, noise) = measure::rendering(&field, &exact, &cameras, arguments.rounds)?;
    rows.extend(measure::extraction(&field, &exact, arguments.rounds)?);

    let name = arguments.field().file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let report = report::report(&folder, &name, &rows, noise)?;
    report.write(&folder)?;
    console::print(&report.markdown());
    console::say!("{}", arguments.out.join("report.html").display());
    Ok(())
}

/// The elevation of the turntable's cameras above the horizon, in radians.
const ELEVATION: f64 = 0.4;

/// Returns the requested number of views, evenly chosen from all cameras.
fn cameras(field: &PlenOctree, arguments: &Arguments) -> Result<Vec<PinholeCamera>> {
    let count = arguments.views as usize;
    let azimuths = (0..count).map(|view| view as f64 / count as f64 * TAU);
    let all = match &arguments.cameras {
        Some(file) => transforms::read(file, Some(arguments.size))?.cameras,
        None => turntable::around(field, arguments.size, azimuths, ELEVATION).unwrap_or_default(),
    };
    if all.is_empty() {
        return Err(format!("{}: the field is empty", arguments.field().display()).into());
    }
    let views = count.min(all.len());
    Ok((0..views).map(|view| all[view * all.len() / views]).collect())
}
