//! Measures what props cost on this machine, and prints tables in Markdown: `scripts/measure` writes them to
//! `docs/performance`.
//!
//! The GPU's time is that of the spans in Bevy's render diagnostics, where the adapter has timestamps. Wall time is that
//! of a frame from its first system until the GPU has drawn it. Everything is measured for a share of ten minutes, so on
//! slow machines fewer frames count, and what does not fit is left out, which the tables say. Names of tables as
//! arguments leave out the others. The file of a field as an argument takes the place of the toadstool.

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/rays.rs"]
mod rays;

mod arrival;
mod clock;
mod frames;
mod presets;
mod sampling;
mod shadows;

use std::{
    path::{Path, PathBuf},
    sync::OnceLock,
    time::{Duration, Instant},
};

use bevy::{
    prelude::*,
    render::{RenderApp, renderer::RenderAdapterInfo},
};
use bevy_plenoctree::headless::Headless;

type Result<T = ()> = std::result::Result<T, Box<dyn std::error::Error>>;

/// The pixels of the views.
const SIZES: [UVec2; 2] = [UVec2::new(800, 800), UVec2::new(1920, 1080)];
const PATIENCE: Duration = Duration::from_secs(300);
/// The included props.
const INCLUDED: [&str; 5] = ["toadstool", "drum", "robot", "gumballs", "chest"];
const TABLES: [&str; 6] = ["sampling", "arrival", "passes", "presets", "shadows", "frames"];

/// Returns the files of the fields that are measured. Tables of one prop show the first one.
fn files() -> &'static [PathBuf] {
    static FILES: OnceLock<Vec<PathBuf>> = OnceLock::new();
    FILES.get_or_init(|| {
        let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets");
        let included = INCLUDED.map(|name| assets.join(name).with_extension("plenoctree"));
        let mut given: Vec<PathBuf> =
            arguments().filter(|name| !TABLES.contains(&name.as_str())).map(Into::into).collect();
        let replaced = given.len().min(1);
        given.extend(included.into_iter().skip(replaced));
        given
    })
}

/// Returns what a table calls the field of a file.
fn name(file: &Path) -> String {
    file.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// Returns the arguments of the command line. Cargo adds `--bench`.
fn arguments() -> impl Iterator<Item = String> {
    std::env::args().skip(1).filter(|argument| !argument.starts_with('-'))
}

fn main() -> Result {
    let start = Instant::now();
    let minutes = |minutes: f64| start + Duration::from_secs_f64(60.0 * minutes);
    let headless = Headless::new(UVec2::ONE, |_| ())?;
    let adapter = headless.app.sub_app(RenderApp).world().resource::<RenderAdapterInfo>().0.clone();
    drop(headless);
    println!("# {}\n", adapter.name);
    let cores = std::thread::available_parallelism()?;
    println!(
        "{:?}, {}, {} {}; {cores} CPU cores. Written by `scripts/measure`; `benches/measure` says what is measured.\n",
        adapter.device_type, adapter.backend, adapter.driver, adapter.driver_info,
    );
    let wanted: Vec<String> = arguments().filter(|name| TABLES.contains(&name.as_str())).collect();
    // When each should end, in minutes.
    let tables: [(f64, fn(Instant) -> Result); TABLES.len()] = [
        (1.5, sampling::measure),
        (2.0, |_| arrival::measure()),
        (3.0, frames::passes),
        (5.0, presets::measure),
        (6.0, shadows::measure),
        (9.5, frames::measure),
    ];
    for (name, (end, measure)) in TABLES.into_iter().zip(tables) {
        if wanted.is_empty() || wanted.iter().any(|wanted| wanted == name) {
            measure(minutes(end))?;
        }
    }
    println!("Measured in {:.0} s.", start.elapsed().as_secs_f64());
    Ok(())
}
