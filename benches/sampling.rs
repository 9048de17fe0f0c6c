//! Counts what rays of radiance sampling and of a view load, and measures sampling on the GPU and on the CPU:
//! `cargo bench --bench sampling -- [FIELD]`.
//!
//! Counts are those of a simulation, of all rays of every few leaves: the cells that a ray crosses until it is hidden or
//! leaves the field. The two samplers run in turns. Times are CPU time for a million rays, from the request
//! to the histograms and the hull, the minimum of three rounds. With a GPU, the time of `gpu` is that of the driver.

#[path = "common/rays.rs"]
mod rays;

use std::{path::PathBuf, time::Duration};

use bevy::prelude::*;
use bevy_plenoctree::{
    LoadSettings, PaletteExtraction, PaletteMethod, PaletteSampler, PlenOctree, PlenOctreePlugin, Posterize, Prop,
    headless::Headless,
};
use cpu_time::ProcessTime;
use plenoctree::{camera::PinholeCamera, sampling::SamplingSettings};
use rays::Rays;

const ROUNDS: usize = 3;
const PATIENCE: Duration = Duration::from_secs(600);

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Cargo adds `--bench`.
    let mut arguments = std::env::args_os().skip(1).filter(|argument| argument != "--bench").map(PathBuf::from);
    let own = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("assets/toadstool.plenoctree");
    let field = PlenOctree::read(arguments.next().unwrap_or_else(own), &LoadSettings::default())?;
    let settings = SamplingSettings::default();
    let view = PinholeCamera::around(&field, 800, 800, 0.5, 0.4).ok_or("the field is empty")?;
    println!("| rays | {} |\n|---|{}", Rays::COLUMNS, "---|".repeat(Rays::COLUMNS.split('|').count()));
    println!("| of sampling | {} |", Rays::of_sampling(&field, &settings));
    println!("| of a view | {} |\n", Rays::of_view(&field, &view));

    let mut headless = Headless::new(UVec2::ONE, |app| {
        app.add_plugins(PlenOctreePlugin);
    })?;
    let rays = field.leaves() * settings.direction_cells() * settings.multisamples.pow(2);
    let world = headless.app.world_mut();
    let mut extraction = world.resource_mut::<PaletteExtraction>();
    extraction.settings.method = PaletteMethod::Hull;
    extraction.budget = None;
    let handle = world.resource_mut::<Assets<PlenOctree>>().add(field);
    world.spawn((Prop(handle.clone()), Posterize::default()));
    headless.wait_until_ready(PATIENCE)?;
    let samplers = [PaletteSampler::Gpu, PaletteSampler::Cpu];
    let mut least = [f64::INFINITY; 2];
    for _ in 0..ROUNDS {
        for (sampler, least) in samplers.into_iter().zip(&mut least) {
            let mut extraction = headless.app.world_mut().resource_mut::<PaletteExtraction>();
            extraction.sampler = sampler;
            extraction.request(&handle);
            let start = ProcessTime::now();
            headless.update();
            while headless.app.world().resource::<PaletteExtraction>().progress(&handle).is_some() {
                std::thread::sleep(Duration::from_millis(5));
                headless.update();
            }
            *least = least.min(start.elapsed().as_secs_f64());
        }
    }
    println!("| sampler | s per million rays | of the CPU |\n|---|---|---|");
    for (name, seconds) in ["gpu", "cpu"].into_iter().zip(least) {
        println!("| {name} | {:.3} | {:.1} |", seconds * 1e6 / rays as f64, seconds / least[1]);
    }
    Ok(())
}
