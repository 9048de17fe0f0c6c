//! From the field to its palette, on whatever the command line says.

use std::{io::BufWriter, path::Path, sync::Arc, time::Duration, time::Instant};

use bevy::{
    prelude::*,
    render::{RenderApp, renderer::RenderAdapterInfo},
};
use bevy_plenoctree::{
    PaletteExtraction, Palettes, PlenOctree, PlenOctreePlugin, Posterize, Prop, Sampled, Sampler,
    headless::Headless,
    palette::{Extraction, Histograms, Progress, extract_from_histograms, sample},
    reference::sample_histograms,
};
use indicatif::ProgressBar;
use npyz::{WriterBuilder, npz::NpzWriter, zip::write::FileOptions};

use crate::{
    Result,
    arguments::{Arguments, Sampling},
};

/// A palette, what it was made from, and what sampled.
pub struct Extracted {
    pub extraction: Extraction,
    pub histograms: Arc<Histograms>,
    pub sampling_on: &'static str,
}

pub fn extract(field: &PlenOctree, arguments: &Arguments, bar: &ProgressBar) -> Result<Extracted> {
    match arguments.sampling {
        Some(Sampling::Cpu) => on_cpu(field, arguments, bar, false),
        Some(Sampling::Reference) if arguments.extraction().sample_fraction < 1.0 => {
            Err("--sampling reference samples every leaf: leave --sample-fraction out".into())
        }
        Some(Sampling::Reference) => on_cpu(field, arguments, bar, true),
        Some(Sampling::Gpu) => on_gpu(field, arguments, bar, Sampler::Gpu),
        // Where there is no app the CPU needs none.
        None => on_gpu(field, arguments, bar, Sampler::Auto).or_else(|error| match error.downcast_ref() {
            Some(bevy_plenoctree::headless::HeadlessError::NoAdapter(_)) => on_cpu(field, arguments, bar, false),
            _ => Err(error),
        }),
    }
}

/// In another thread, so that this one can show how far it is.
fn on_cpu(field: &PlenOctree, arguments: &Arguments, bar: &ProgressBar, reference: bool) -> Result<Extracted> {
    let progress = Arc::new(Progress::default());
    let (field, settings, shared) = (field.clone(), arguments.extraction(), progress.clone());
    let worker = std::thread::spawn(move || -> Result<Extracted, String> {
        settings.validate().map_err(|error| error.to_string())?;
        let start = Instant::now();
        let histograms = if reference {
            sample_histograms(&field, &settings).map_err(|error| error.to_string())?
        } else {
            sample(&field, &settings, &shared).map_err(|error| error.to_string())?
        };
        let sampling = start.elapsed().as_secs_f64();
        let mut extraction = extract_from_histograms(&histograms, &settings).map_err(|error| error.to_string())?;
        extraction.seconds.sampling = sampling;
        let sampling_on = if reference { "reference" } else { "cpu" };
        Ok(Extracted { extraction, histograms: Arc::new(histograms), sampling_on })
    });
    while !worker.is_finished() {
        bar.set_position((100.0 * progress.fraction()) as u64);
        std::thread::sleep(Duration::from_millis(20));
    }
    Ok(worker.join().map_err(|_| "extraction stopped unexpectedly")??)
}

/// In an app of its own, as a game does it.
fn on_gpu(field: &PlenOctree, arguments: &Arguments, bar: &ProgressBar, sampler: Sampler) -> Result<Extracted> {
    let mut headless = Headless::new(UVec2::ONE, |app| {
        app.add_plugins(PlenOctreePlugin);
    })?;
    let adapter = headless.app.sub_app(RenderApp).world().get_resource::<RenderAdapterInfo>();
    if sampler == Sampler::Auto && adapter.is_none_or(|adapter| adapter.device_type == wgpu::DeviceType::Cpu) {
        return on_cpu(field, arguments, bar, false);
    }
    let world = headless.app.world_mut();
    let mut extraction = world.resource_mut::<PaletteExtraction>();
    extraction.settings = arguments.extraction();
    extraction.sampler = sampler;
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
        let found = world.resource::<Palettes>().get(&handle).and_then(|palette| palette.extraction());
        if let (Some(found), Some(Sampled { histograms, on_gpu })) = (found, extraction.sampled(&handle)) {
            let sampling_on = if *on_gpu { "gpu" } else { "cpu" };
            return Ok(Extracted { extraction: found.clone(), histograms: histograms.clone(), sampling_on });
        }
        bar.set_position((100.0 * extraction.progress(&handle).unwrap_or(0.0)) as u64);
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Writes `fine` and `coarse`, float64, index [r, g, b], not normalized.
pub fn write_histograms(histograms: &Histograms, arguments: &Arguments, path: &Path) -> Result<()> {
    let settings = arguments.extraction();
    let failed = |error: std::io::Error| format!("{}: {error}", path.display());
    let file = std::fs::File::create(path).map_err(failed)?;
    let mut archive = NpzWriter::new(BufWriter::new(file));
    for (name, weights, bins) in
        [("fine", histograms.fine(), settings.fine_bins), ("coarse", histograms.coarse(), settings.coarse_bins)]
    {
        let shape = [bins as u64; 3];
        // Without the time of writing, so that the same field gives the same file.
        let options = FileOptions::default().last_modified_time(Default::default());
        let mut array =
            archive.array(name, options).map_err(failed)?.default_dtype().shape(&shape).begin_nd().map_err(failed)?;
        array.extend(weights.iter().copied()).map_err(failed)?;
        array.finish().map_err(failed)?;
    }
    Ok(())
}
