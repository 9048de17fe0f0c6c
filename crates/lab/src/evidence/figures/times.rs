//! Table 1: how long everything takes.

use plenoctree_cli::{
    renderer::{Look, PosterizeSettings, Renderer},
    result::Result,
};

use super::super::{data::Evidence, methods::Method};
use crate::report::{Cell, Section, Table};

/// The number of frames that are timed.
const FRAMES: usize = 5;

/// Lists the time of every step of the extraction, and the frame rate.
pub fn section(evidence: &mut Evidence, renderer: Renderer) -> Result<Section> {
    let mut section = Section::new("Table 1: time");
    let fps = frames_per_second(evidence, renderer)?;
    let camera = evidence.shots[0].camera;
    let adapter = evidence.renderer.adapter();
    section.text(match fps {
        Some(_) => format!(
            "Seconds of every step. Sampling is on the CPU, on all cores. Frames of {} x {} pixels, posterized, on {} \
             ({}), each until it is in memory.",
            camera.width, camera.height, adapter.name, adapter.backend
        ),
        None => "Seconds of every step. Sampling is on the CPU, on all cores. Frame rates are measured only with the \
                 plugin: the float64 reference is not meant to be fast."
            .into(),
    });
    let head = vec![
        ("palette", "palette"),
        ("N_sp", "n_sp"),
        ("K", "k"),
        ("sampling, s", "sampling_seconds"),
        ("filtering, s", "filtering_seconds"),
        ("hull, s", "hull_seconds"),
        ("fit, s", "fit_seconds"),
        ("in all, s", "total_seconds"),
        ("frames per second", "frames_per_second"),
    ];
    let row = |method: Method| {
        let report = &evidence.extractions[method as usize].report;
        let seconds = report.seconds;
        let times = [seconds.sampling, seconds.filtering, seconds.hull, seconds.fitting];
        let mut row = vec![
            Cell::name(method.label(), method.name()),
            Cell::Number(evidence.field.leaves() as f64, 0),
            Cell::number(report.clusters.map(|clusters| clusters as f64), 0),
        ];
        row.extend(times.map(|seconds| Cell::number((seconds > 0.0).then_some(seconds), 3)));
        row.extend([Cell::Number(times.iter().sum(), 3), Cell::number(fps, 1)]);
        row
    };
    let rows = [Method::Hull, Method::Fitted].map(row).into();
    section.table(&evidence.folder, "table_1", Table { head, rows })?;
    Ok(section)
}

/// Measures frames with the plugin: the median of a few.
fn frames_per_second(evidence: &mut Evidence, renderer: Renderer) -> Result<Option<f64>> {
    if renderer == Renderer::Reference {
        return Ok(None);
    }
    let palette = evidence.methods.palette(Method::Hull);
    let look = Look { palette, shown: &palette.colors, settings: PosterizeSettings::default() };
    let camera = evidence.shots[0].camera;
    let mut milliseconds = Vec::new();
    for _ in 0..FRAMES {
        milliseconds.extend(evidence.renderer.posterized(&camera, &look)?.1.total);
    }
    milliseconds.sort_by(f64::total_cmp);
    Ok(milliseconds.get(milliseconds.len() / 2).map(|milliseconds| 1e3 / milliseconds))
}
