//! Radiance sampling, what its rays load, and what the rays of a view load.

use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy_plenoctree::{
    LoadSettings, PaletteExtraction, PaletteMethod, PaletteSampler, Palettes, PlenOctree, PlenOctreePlugin, Prop,
    SamplingSettings, headless::Headless,
};

use crate::{PATIENCE, Result, files, name, rays::Rays};

pub fn measure(end: Instant) -> Result {
    println!(
        "## Sampling\n\nSeconds until a field's histograms are known, in a single frame on the GPU, with planning.\n"
    );
    println!("| field | million rays | on the GPU | on the CPU | {} |", Rays::COLUMNS);
    println!("|---|---|---|---|{}", "---|".repeat(Rays::COLUMNS.split('|').count()));
    let settings = SamplingSettings::default();
    for file in files() {
        let field = PlenOctree::read(file, &LoadSettings::default())?;
        let name = name(file);
        let rays = field.leaves() * settings.direction_cells() * settings.multisamples.pow(2);
        if Instant::now() > end {
            println!("| {name} | {:.1} | not measured: the time was up | |", rays as f64 / 1e6);
            continue;
        }
        let counts = Rays::of_sampling(&field, &settings);
        let [gpu, cpu] = [PaletteSampler::Gpu, PaletteSampler::Cpu].map(|sampler| seconds(&field, sampler));
        println!("| {name} | {:.1} | {:.2} | {:.2} | {counts} |", rays as f64 / 1e6, gpu?, cpu?);
    }
    println!();
    Ok(())
}

/// Returns the seconds of sampling.
fn seconds(field: &PlenOctree, sampler: PaletteSampler) -> Result<f64> {
    let mut headless = Headless::new(UVec2::ONE, |app| {
        app.add_plugins(PlenOctreePlugin);
    })?;
    let world = headless.app.world_mut();
    let field = world.resource_mut::<Assets<PlenOctree>>().add(field.clone());
    // The field arrives first.
    world.spawn(Prop(field.clone()));
    headless.wait_until_ready(PATIENCE)?;
    let world = headless.app.world_mut();
    let mut extraction = world.resource_mut::<PaletteExtraction>();
    extraction.settings.method = PaletteMethod::Hull;
    extraction.sampler = sampler;
    extraction.budget = None;
    extraction.request(&field);
    let start = Instant::now();
    while headless.app.world().resource::<Palettes>().get(&field).is_none() && start.elapsed() < PATIENCE {
        headless.update();
        std::thread::sleep(Duration::from_millis(1));
    }
    let palette = headless.app.world().resource::<Palettes>().get(&field).ok_or("sampling took too long")?;
    Ok(palette.extraction().ok_or("the palette was not extracted")?.seconds.sampling)
}
