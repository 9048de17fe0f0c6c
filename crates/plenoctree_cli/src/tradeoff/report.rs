//! Formats the rows as text.

use std::collections::BTreeMap;

use super::measure::Row;

/// A setting is worthwhile if one of its values saves at least this share of the time, and at least twice the noise.
const WORTH: f64 = 0.05;

/// Formats comma-separated values, for programs.
pub fn csv(rows: &[Row]) -> String {
    let mut text =
        String::from("setting,value,milliseconds,ratio_to_exact,psnr_db,ssim,label_changes,flicker,palette_error\n");
    let number = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value:.6}"));
    for row in rows {
        text += &format!(
            "{},{},{:.3},{:.4},{},{},{},{},{}\n",
            row.setting,
            row.value,
            row.milliseconds,
            row.ratio_to_exact,
            number(row.psnr_db),
            number(row.ssim),
            number(row.label_changes),
            number(row.flicker),
            number(row.palette_error),
        );
    }
    text
}

/// Formats a table and its conclusions.
pub fn markdown(rows: &[Row], noise: f64) -> String {
    let mut text = String::from(
        "| setting | value | ms | of exact | PSNR, dB | SSIM | labels changed | flicker | palette | best |\n|---|---|---|---|---|---|---|---|---|---|\n",
    );
    let number = |value: Option<f64>, digits: usize, unit: &str| {
        value.map_or(String::new(), |value| format!("{value:.digits$}{unit}"))
    };
    for row in rows {
        text += &format!(
            "| {} | {} | {:.1} | {:.2} | {} | {} | {} | {} | {} | {} |\n",
            row.setting,
            row.value,
            row.milliseconds,
            row.ratio_to_exact,
            number(row.psnr_db, 1, ""),
            number(row.ssim, 4, ""),
            number(row.label_changes.map(|share| 100.0 * share), 2, " %"),
            number(row.flicker, 4, ""),
            number(row.palette_error, 3, ""),
            if is_best(row, rows) { "*" } else { "" },
        );
    }
    text += "\n\\* nothing else is both faster and closer to the exact frame.\n";
    text += &format!("\nRatios of two series of exact frames are off by {:.1}%.\n", 100.0 * noise);
    let saved = WORTH.max(2.0 * noise);
    let worthless = not_worthwhile(rows, saved);
    if !worthless.is_empty() {
        let list = worthless.join(", ");
        text +=
            &format!("\nNot worthwhile here, because they save less than {:.0}% of the time: {list}.\n", 100.0 * saved);
    }
    text
}

/// Whether a row is on the Pareto front of time and PSNR.
pub fn is_best(row: &Row, rows: &[Row]) -> bool {
    let Some(psnr) = row.psnr_db else { return false };
    !rows.iter().any(|other| {
        let Some(theirs) = other.psnr_db else { return false };
        let (faster, nearer) = (other.ratio_to_exact <= row.ratio_to_exact, theirs >= psnr);
        faster && nearer && (other.ratio_to_exact < row.ratio_to_exact || theirs > psnr)
    })
}

fn not_worthwhile(rows: &[Row], saved: f64) -> Vec<&'static str> {
    let mut best = BTreeMap::new();
    for row in rows.iter().filter(|row| !["exact", "preset", "changes", "extraction"].contains(&row.setting)) {
        let least = best.entry(row.setting).or_insert(f64::INFINITY);
        *least = row.ratio_to_exact.min(*least);
    }
    best.into_iter().filter(|(_, ratio)| *ratio > 1.0 - saved).map(|(setting, _)| setting).collect()
}
