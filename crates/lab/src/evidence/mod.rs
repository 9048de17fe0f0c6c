//! `evidence`: reproduces the figures of the paper that compare methods, on any field, and writes them as a report.
//!
//! Most views in the report are not ones that palettes were made from. All posterized pictures use the same labels, the
//! same filter and the same assignment, so that only the palettes differ.

mod arguments;
mod baselines;
mod crop;
mod data;
mod figures;
mod measures;
mod methods;
mod shot;
mod views;

pub use arguments::Arguments;

use plenoctree::{
    palette::{ColorCount, ExtractionSettings, PaletteMethod, extract_from_samples},
    sampling::Progress,
};

use crate::report::{Folder, Report};
use data::Evidence;
use methods::{Method, Methods};
use plenoctree_cli::{console, extraction, field, files, preset::Preset, progress, renderer::Scene, result::Result};
use shot::Shot;

/// Finds the palettes, renders the views, and writes the report.
pub fn run(arguments: &Arguments) -> Result {
    let path = &field::or_default(arguments.field.as_deref());
    let named = |error: Box<dyn std::error::Error>| format!("{}: {error}", path.display());
    let field = field::load(path, arguments.quiet)?;
    let views = views::select(&field, path, arguments)?;
    files::create_folder(&arguments.out)?;
    let folder = Folder::create(&arguments.out)?;

    let colors = arguments.colors as usize;
    let settings = |method| ExtractionSettings { method, colors: ColorCount::Fixed(colors), ..Default::default() };
    let hull = extraction::cpu::extract(&field, &settings(PaletteMethod::Hull), arguments.quiet).map_err(named)?;
    let histograms = hull.histograms;
    let mut fitted = extract_from_samples(&histograms, &[], &settings(PaletteMethod::Fitted), &Progress::default())
        .map_err(|error| named(error.into()))?;
    fitted.report.seconds.sampling = hull.extraction.report.seconds.sampling;
    let extractions = [hull.extraction, fitted];

    let cameras = [&views.examples[..], &views.shown].concat();
    let scene = Scene { field: field.clone(), quality: Preset::Exact, background: [255; 3] };
    let mut renderer = arguments.renderer.start(scene, &cameras).map_err(named)?;
    let examples: Vec<_> = views.examples.iter().map(|camera| renderer.original(camera)).collect::<Result<_>>()?;
    let [hull, fitted] = &extractions;
    let methods = Methods::find(
        &field,
        &ExtractionSettings::default(),
        &histograms,
        [hull, fitted],
        &examples,
        colors,
        arguments.quiet,
    )
    .map_err(named)?;
    let drawings = Method::ALL.map(|method| folder.palette(method.name(), methods.palette(method)));
    let drawings = drawings.into_iter().collect::<Result<_>>()?;

    let bar = progress::bar("views", views.shown.len() as u64, arguments.quiet);
    let mut shots = Vec::new();
    for camera in &views.shown {
        shots.push(Shot::render(&mut *renderer, camera, &methods)?);
        bar.inc(1);
    }
    bar.finish_and_clear();

    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut evidence =
        Evidence { name, field, views, renderer, folder, histograms, extractions, methods, drawings, shots };
    let sections = figures::all(&mut evidence, &examples, arguments).map_err(named)?;
    let report = Report { title: format!("Evidence: {}", evidence.name), sections };
    report.write(&evidence.folder)?;
    if !arguments.quiet {
        console::say!("report of {} saved to {}", path.display(), arguments.out.join("report.html").display());
    }
    Ok(())
}
