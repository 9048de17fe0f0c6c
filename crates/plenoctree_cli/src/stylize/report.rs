//! Writes the measurements to `report.json`.

use std::path::Path;

use plenoctree::{
    PlenOctree,
    palette::{Palette, PaletteMethod},
};
use serde_json::{Value, json};

use crate::{
    extraction::Extracted,
    files, gpu_memory,
    renderer::{Adapter, FrameTimes},
    result::Result,
};

/// Writes the report. `frames` holds the names of every view's files and its times.
pub fn write(
    folder: &Path,
    field: &PlenOctree,
    adapter: &Adapter,
    extracted: Option<&Extracted>,
    palette: &Palette,
    frames: &[(Vec<String>, FrameTimes)],
) -> Result {
    let times =
        |times: &FrameTimes| json!({"volume": times.volume, "posterize": times.posterize, "total": times.total});
    let medians = FrameTimes {
        volume: median(frames.iter().filter_map(|(_, times)| times.volume)),
        posterize: median(frames.iter().filter_map(|(_, times)| times.posterize)),
        total: median(frames.iter().filter_map(|(_, times)| times.total)),
    };
    let report = json!({
        "adapter": {"name": adapter.name, "backend": adapter.backend, "driver": adapter.driver},
        "field": {
            "leaves": field.leaves(),
            "depth": field.depth(),
            "basis": field.basis().name(),
            "gpu_bytes": gpu_memory::bytes(field),
        },
        "palette": palette_report(extracted, palette),
        "frames": frames
            .iter()
            .map(|(files, milliseconds)| json!({"file": files[0], "files": files, "milliseconds": times(milliseconds)}))
            .collect::<Vec<_>>(),
        "medians": {"milliseconds": times(&medians)},
    });
    let text = serde_json::to_string_pretty(&report)?;
    files::write_text(&folder.join("report.json"), &(text + "\n"))
}

/// Reports the palette. Entries about extraction are null for a palette that was given.
fn palette_report(extracted: Option<&Extracted>, palette: &Palette) -> Value {
    let report = extracted.map(|extracted| &extracted.extraction.report);
    json!({
        "colors": palette.colors.len(),
        "method": palette.method.map(PaletteMethod::name),
        "sampling_on": extracted.map(|extracted| extracted.sampling_on),
        "radiance_samples": report.map(|r| r.radiance_samples),
        "total_weight": report.map(|r| r.total_weight),
        "clusters": report.and_then(|r| r.clusters),
        "hull_vertices": report.and_then(|r| r.hull_vertices),
        "seconds": report.map(|r| json!({
            "sampling": r.seconds.sampling,
            "filtering": r.seconds.filtering,
            "hull": r.seconds.hull,
            "fitting": r.seconds.fitting,
        })),
    })
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => None,
        n if n % 2 == 1 => Some(values[middle]),
        _ => Some(0.5 * (values[middle - 1] + values[middle])),
    }
}
