//! Plots of accuracy over time.

use super::measure::Row;
use crate::plot::{COLORS, Line, Mark, Plot};

/// Plots every row that has a `value` over its time relative to the exact frame. A line joins the Pareto front.
pub fn svg(rows: &[Row], label: &str, from_zero: bool, value: impl Fn(&Row) -> Option<f64>) -> String {
    let points: Vec<_> = rows.iter().filter_map(|row| Some((row, (row.ratio_to_exact, value(row)?)))).collect();
    let mut front: Vec<_> = points.iter().filter(|(row, _)| row.is_best(rows)).map(|(_, at)| *at).collect();
    front.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mark = |(row, at): &(&Row, (f64, f64))| Mark {
        at: *at,
        label: format!("{} {}", row.setting, row.value),
        color: match (row.is_best(rows), row.setting) {
            (_, "preset" | "exact") => COLORS[1],
            (true, _) => COLORS[2],
            _ => COLORS[0],
        },
    };
    Plot {
        title: label,
        x: "time, relative to the exact frame",
        y: label,
        lines: &[Line {
            label: "nothing else is faster and closer".into(),
            color: COLORS[2],
            dashed: false,
            points: front,
        }],
        marks: &points.iter().map(mark).collect::<Vec<_>>(),
        from_zero,
    }
    .svg()
}
