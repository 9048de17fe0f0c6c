//! The report: a table with its conclusions, and plots.

use std::collections::BTreeMap;

use plenoctree_cli::result::Result;

use super::{measure::Row, plot};
use crate::report::{Cell, Folder, Report, Section, Table};

/// A setting is worthwhile if one of its values saves at least this share of the time, and at least twice the noise.
const WORTH: f64 = 0.05;

/// Writes the table and the plots to a folder, and returns the report on the field named `name`.
pub fn report(folder: &Folder, name: &str, rows: &[Row], noise: f64) -> Result<Report> {
    let percent = |row: &Row| row.label_changes.map(|share| 100.0 * share);
    let mut section = Section::new("Settings");
    section.table(folder, "tradeoff", table(rows, percent))?;
    section.text("* nothing else is both faster and closer to the exact frame.");
    section.text(format!("Ratios of two series of exact frames are off by {:.1}%.", 100.0 * noise));
    let saved = WORTH.max(2.0 * noise);
    let worthless = not_worthwhile(rows, saved);
    if !worthless.is_empty() {
        let (share, list) = (100.0 * saved, worthless.join(", "));
        section.text(format!("Not worthwhile here, because they save less than {share:.0}% of the time: {list}."));
    }
    for (name, label, svg) in [
        ("psnr", "PSNR, dB", plot::svg(rows, "PSNR, dB", false, |row| row.psnr_db)),
        ("labels", "label changes", plot::svg(rows, "label changes, %", true, percent)),
    ] {
        section.plot(folder.plot(name, &svg)?, format!("{label} over time"));
    }
    Ok(Report { title: format!("Tradeoff: {name}"), sections: vec![section] })
}

fn table(rows: &[Row], percent: impl Fn(&Row) -> Option<f64>) -> Table {
    let cells = |row: &Row| {
        vec![
            Cell::text(row.setting),
            Cell::text(&row.value),
            Cell::Number(row.milliseconds, 1),
            Cell::Number(row.ratio_to_exact, 2),
            Cell::number(row.psnr_db, 1),
            Cell::number(row.ssim, 4),
            Cell::number(percent(row), 2),
            Cell::number(row.flicker, 4),
            Cell::number(row.palette_error, 3),
            Cell::text(if row.is_best(rows) { "*" } else { "" }),
        ]
    };
    Table {
        head: vec![
            ("setting", "setting"),
            ("value", "value"),
            ("ms", "milliseconds"),
            ("of exact", "ratio_to_exact"),
            ("PSNR, dB", "psnr_db"),
            ("SSIM", "ssim"),
            ("labels changed, %", "label_changes_percent"),
            ("flicker", "flicker"),
            ("palette", "palette_error"),
            ("best", "best"),
        ],
        rows: rows.iter().map(cells).collect(),
    }
}

fn not_worthwhile(rows: &[Row], saved: f64) -> Vec<&'static str> {
    let mut best = BTreeMap::new();
    for row in rows.iter().filter(|row| !["exact", "preset", "changes", "extraction"].contains(&row.setting)) {
        let least = best.entry(row.setting).or_insert(f64::INFINITY);
        *least = row.ratio_to_exact.min(*least);
    }
    best.into_iter().filter(|(_, ratio)| *ratio > 1.0 - saved).map(|(setting, _)| setting).collect()
}
