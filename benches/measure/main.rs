//! Measures what props cost on this machine, and prints tables in Markdown: `scripts/measure` writes them to
//! `docs/performance`.
//!
//! The GPU's time is that of the spans in Bevy's render diagnostics, where the adapter has timestamps. Wall time is that
//! of a frame from its first system until the GPU has drawn it. Everything is measured for a share of ten minutes, so on
//! slow machines fewer frames count, and what does not fit is left out, which the tables say. Names of tables as
//! arguments leave out the others.

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/rays.rs"]
mod rays;

mod arrival;
mod clock;
mod frames;
mod sampling;
mod shadows;

use std::{
    path::PathBuf,
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
const FIELDS: [&str; 5] = ["toadstool", "drum", "robot", "gumballs", "chest"];

fn assets() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("assets")
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
    let names: Vec<String> = std::env::args().skip(1).filter(|name| !name.starts_with('-')).collect();
    let wants = |name: &str| names.is_empty() || names.iter().any(|wanted| wanted == name);
    // When each should end, in minutes.
    let tables: [(&str, f64, fn(Instant) -> Result); 5] = [
        ("sampling", 1.5, sampling::measure),
        ("arrival", 2.0, |_| arrival::measure()),
        ("passes", 3.5, frames::passes),
        ("shadows", 5.0, shadows::measure),
        ("frames", 9.5, frames::measure),
    ];
    for (name, end, measure) in tables {
        if wants(name) {
            measure(minutes(end))?;
        }
    }
    println!("Measured in {:.0} s.", start.elapsed().as_secs_f64());
    Ok(())
}
