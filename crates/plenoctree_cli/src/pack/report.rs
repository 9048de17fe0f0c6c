//! A table and plots of what every quality gives.

use std::path::Path;

use plenoctree::Packed;

use super::{
    arguments::Quality,
    measure::{Loss, Views},
};
use crate::{Result, files, plot};

/// What a quality gives.
pub struct Row {
    quality: Quality,
    bytes: usize,
    leaves: usize,
    dropped: usize,
    loss: Loss,
}

impl Row {
    /// Measures a packed field.
    pub fn new(quality: Quality, packed: &Packed, views: &Views) -> Self {
        let field = packed.field();
        Self {
            quality,
            bytes: packed.bytes().len(),
            leaves: field.leaves(),
            dropped: packed.dropped(),
            loss: views.compare(field),
        }
    }
}

/// Writes `packing.md`, `psnr.svg` and `labels.svg`. `before` is the size of the field's file.
pub fn write(folder: &Path, field: &Path, before: u64, rows: &[Row]) -> Result {
    files::create_folder(folder)?;
    let name = field.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let mut text = format!(
        "{name}, {:.2} MB:\n\n| quality | MB | of the file | leaves | dropped | PSNR, dB | labels changed | palette \
         |\n|---|---|---|---|---|---|---|---|\n",
        before as f64 / 1e6
    );
    for Row { quality, bytes, leaves, dropped, loss } in rows {
        text += &format!(
            "| {} | {:.2} | 1/{:.0} | {leaves} | {:.0} % | {:.1} | {:.2} % | {:.3} |\n",
            quality.name(),
            *bytes as f64 / 1e6,
            before as f64 / *bytes as f64,
            100.0 * *dropped as f64 / (leaves + dropped).max(1) as f64,
            loss.psnr,
            loss.labels,
            loss.palette,
        );
    }
    files::write_text(&folder.join("packing.md"), &text)?;
    let line = |label: &str, of: fn(&Loss) -> f64| {
        let points = rows.iter().map(|row| (row.bytes as f64 / 1e6, of(&row.loss))).collect();
        [plot::Line { label: label.into(), color: plot::COLORS[1], dashed: false, points }]
    };
    let psnr = plot::lines(&name, "size, MB", "PSNR against the field, dB", &line("PSNR", |loss| loss.psnr));
    let labels = plot::lines(&name, "size, MB", "labels changed, %", &line("labels changed", |loss| loss.labels));
    files::write_text(&folder.join("psnr.svg"), &psnr)?;
    files::write_text(&folder.join("labels.svg"), &labels)?;
    print!("{text}");
    println!("{}", folder.display());
    Ok(())
}
