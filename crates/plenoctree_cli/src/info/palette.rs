//! Describes a palette.

use std::path::Path;

use plenoctree::palette::Palette;
use serde_json::{Value, json};

use super::report::{Report, size, table};
use crate::{files, hex, result::Result, swatches};

/// Reads a palette and describes it.
pub fn report(path: &Path) -> Result<Report> {
    let palette = Palette::read(path)?;
    let file_bytes = files::size(path)?;
    let color = |(color, weight): (&[f64; 3], &f64)| -> Value {
        json!({"hex": hex::format(hex::quantize(*color)), "color": color, "weight": weight})
    };
    let colors: Vec<Value> = palette.colors.iter().zip(&palette.weights).map(color).collect();
    let json = json!({"file": path.display().to_string(), "file_bytes": file_bytes, "colors": colors, "ramps": palette.ramps,
            "shown": palette.shown});

    let hex = |color: &[f64; 3]| hex::format(hex::quantize(*color));
    let mut lines = vec![("file size", size(file_bytes)), ("colors", palette.colors.len().to_string())];
    if !palette.shown.is_empty() {
        lines.push(("shown as", palette.shown.iter().map(hex).collect::<Vec<_>>().join(" ")));
    }
    Ok(Report { text: table(path, &lines) + &swatches::lines(&palette), json })
}
