//! Sampling on the GPU, in a separate app, as in a game.

use std::{thread, time::Duration};

use bevy::{
    prelude::*,
    render::{RenderApp, renderer::RenderAdapterInfo},
};
use bevy_plenoctree::{
    ExtractionSamples, PaletteExtraction, PaletteSampler, Palettes, PlenOctreePlugin, Posterize, Prop, SampleOrigin,
    headless::{Headless, HeadlessError},
};
use plenoctree::{
    PlenOctree,
    palette::{Extraction, ExtractionSettings},
};

use super::{cpu, extracted::Extracted};
use crate::{progress, result::Result};

/// Samples with compute shaders.
pub fn extract(field: &PlenOctree, settings: &ExtractionSettings, quiet: bool) -> Result<Extracted> {
    run(app()?, field, settings, quiet)
}

/// Samples with compute shaders if there is a hardware GPU, and on the CPU otherwise.
pub fn extract_or_fall_back(field: &PlenOctree, settings: &ExtractionSettings, quiet: bool) -> Result<Extracted> {
    match app() {
        Ok(app) if is_hardware(&app) => run(app, field, settings, quiet),
        Ok(_) | Err(HeadlessError::NoAdapter(_)) => cpu::extract(field, settings, quiet),
        Err(error) => Err(error.into()),
    }
}

fn app() -> Result<Headless, HeadlessError> {
    Headless::new(UVec2::ONE, |app| {
        app.add_plugins(PlenOctreePlugin);
    })
}

/// Whether the app renders on a GPU instead of CPU cores.
fn is_hardware(headless: &Headless) -> bool {
    let adapter = headless.app.sub_app(RenderApp).world().get_resource::<RenderAdapterInfo>();
    adapter.is_some_and(|adapter| adapter.device_type != wgpu::DeviceType::Cpu)
}

/// Updates the app until the palette is ready.
fn run(mut headless: Headless, field: &PlenOctree, settings: &ExtractionSettings, quiet: bool) -> Result<Extracted> {
    let bar = progress::bar("extracting", 100, quiet);
    let world = headless.app.world_mut();
    let mut extraction = world.resource_mut::<PaletteExtraction>();
    extraction.settings = settings.clone();
    extraction.sampler = PaletteSampler::Gpu;
    extraction.budget = None;
    let handle = world.resource_mut::<Assets<PlenOctree>>().add(field.clone());
    world.spawn((Prop(handle.clone()), Posterize::default()));
    loop {
        headless.update();
        let world = headless.app.world();
        let extraction = world.resource::<PaletteExtraction>();
        if let Some(error) = extraction.error(&handle) {
            return Err(error.clone().into());
        }
        let found = world.resource::<Palettes>().get(&handle);
        let found = found.and_then(|palette| Some((palette.palette(), *palette.extraction()?)));
        if let (Some((palette, report)), Some(samples)) = (found, extraction.sampled(&handle)) {
            let ExtractionSamples { histograms, origin } = samples;
            let sampling_on = match origin {
                SampleOrigin::Gpu => "gpu",
                SampleOrigin::Cpu => "cpu",
                SampleOrigin::Recorded => "file",
            };
            bar.finish_and_clear();
            let extraction = Extraction { palette: palette.clone(), report };
            return Ok(Extracted { extraction, histograms: histograms.clone(), sampling_on });
        }
        bar.set_position((100.0 * extraction.progress(&handle).unwrap_or(0.0)) as u64);
        thread::sleep(Duration::from_millis(1));
    }
}
