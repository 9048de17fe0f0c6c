//! A table and plots of the results of every quality.

use std::path::Path;

use glam::DVec3;
use plenoctree::{Packed, palette::Palette};
use plenoctree_cli::{
    console, files,
    pack::{Loss, Quality, Views, palette},
    result::Result,
};

use crate::plot;

/// The results of a quality.
pub struct Row {
    quality: Quality,
    bytes: usize,
    leaves: usize,
    dropped: usize,
    loss: Loss,
    /// The largest difference of a channel between the packed field's palette and the field's.
    palette: f64,
}

impl Row {
    /// Measures a packed field, which had `before` leaves.
    pub fn new(quality: Quality, before: usize, packed: &Packed, views: &Views) -> Self {
        let field = packed.field();
        Self {
            quality,
            bytes: packed.bytes().len(),
            leaves: field.leaves(),
            dropped: before - field.leaves(),
            loss: views.compare(field),
            palette: match (palette(field), views.palette()) {
                (Ok(found), Some(expected)) => difference(&found, expected),
                _ => 1.0,
            },
        }
    }
}

/// What the qualities give for a field.
pub struct Field {
    /// Its file's name, without the extension.
    pub name: String,
    /// The size of its file.
    pub before: u64,
    pub rows: Vec<Row>,
}

/// Writes `packing.md`, `psnr.svg` and `labels.svg`.
pub fn write(folder: &Path, fields: &[Field]) -> Result {
    let mut text = String::from(
        "| field | quality | MB before | MB | of the file | leaves | dropped | PSNR, dB | labels changed | palette \
         |\n|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for Field { name, before, rows } in fields {
        for Row { quality, bytes, leaves, dropped, loss, palette } in rows {
            text += &format!(
                "| {name} | {} | {:.2} | {:.2} | 1/{:.0} | {leaves} | {:.0}% | {:.1} | {:.2}% | {:.3} |\n",
                quality.name(),
                *before as f64 / 1e6,
                *bytes as f64 / 1e6,
                *before as f64 / *bytes as f64,
                100.0 * *dropped as f64 / (leaves + dropped).max(1) as f64,
                loss.psnr,
                loss.labels,
                palette,
            );
        }
    }
    files::write_text(&folder.join("packing.md"), &text)?;
    let lines = |of: fn(&Loss) -> f64| -> Vec<plot::Line> {
        let line = |(Field { name, rows, .. }, color): (&Field, &&'static str)| {
            let points = rows.iter().map(|row| (row.bytes as f64 / 1e6, of(&row.loss))).collect();
            plot::Line { label: name.clone(), color, dashed: false, points }
        };
        fields.iter().zip(plot::COLORS.iter().cycle()).map(line).collect()
    };
    let psnr = plot::lines("Packed fields", "size, MB", "PSNR against the field, dB", &lines(|loss| loss.psnr));
    let labels = plot::lines("Packed fields", "size, MB", "labels changed, %", &lines(|loss| loss.labels));
    files::write_text(&folder.join("psnr.svg"), &psnr)?;
    files::write_text(&folder.join("labels.svg"), &labels)?;
    console::print(&text);
    console::say!("{}", folder.display());
    Ok(())
}

/// Returns the largest difference of a channel between a color and the nearest of the other palette.
fn difference(found: &Palette, expected: &Palette) -> f64 {
    let of_color = |color: &[f64; 3]| {
        let most = |other: &[f64; 3]| (DVec3::from(*color) - DVec3::from(*other)).abs().max_element();
        expected.colors.iter().map(most).fold(f64::INFINITY, f64::min)
    };
    found.colors.iter().map(of_color).fold(0.0, f64::max)
}
