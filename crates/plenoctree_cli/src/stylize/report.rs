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
    let frame = |(files, times): &(Vec<String>, FrameTimes)| {
        let milliseconds = json!({"volume": times.volume, "posterize": times.posterize, "total": times.total});
        json!({"file": files[0], "files": files, "milliseconds": milliseconds})
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
        "frames": frames.iter().map(frame).collect::<Vec<_>>(),
    });
    let (path, text) = (folder.join("report.json"), serde_json::to_string_pretty(&report)?);
    files::keep_former_report(&path, |former| former.get("frames").is_some())?;
    files::write_text(&path, &(text + "\n"))
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
