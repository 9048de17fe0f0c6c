//! Plots of accuracy over time.

use super::{measure::Row, report::is_best};

const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 460.0;
const MARGIN: f64 = 60.0;

/// Plots every row that has a `value` over its time relative to the exact frame. A line joins the Pareto front.
pub fn svg(rows: &[Row], label: &str, higher_is_better: bool, value: impl Fn(&Row) -> Option<f64>) -> String {
    let points: Vec<_> = rows.iter().filter_map(|row| Some((row, row.ratio_to_exact, value(row)?))).collect();
    let most = |of: fn(&(&Row, f64, f64)) -> f64| points.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
    let right = most(|point| point.1).max(1.0);
    let top = most(|point| point.2);
    let bottom = if higher_is_better { -most(|point| -point.2) } else { 0.0 };
    let height = (top - bottom).max(1e-9);
    let x = |ratio: f64| MARGIN + ratio / right * (WIDTH - 2.0 * MARGIN);
    let y = |value: f64| HEIGHT - MARGIN - (value - bottom) / height * (HEIGHT - 2.0 * MARGIN);

    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{HEIGHT}\" font-family=\"sans-serif\" \
         font-size=\"11\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n<text x=\"{MARGIN}\" y=\"24\" \
         font-size=\"14\">{label}, over the time relative to the exact frame</text>\n"
    );
    for step in 0..=4 {
        let (ratio, value) = (right * f64::from(step) / 4.0, bottom + height * f64::from(step) / 4.0);
        text += &format!(
            "<line x1=\"{0}\" y1=\"{MARGIN}\" x2=\"{0}\" y2=\"{1}\" stroke=\"#ddd\"/><text x=\"{0}\" y=\"{2}\" \
             text-anchor=\"middle\">{ratio:.2}</text>\n<line x1=\"{MARGIN}\" y1=\"{3}\" x2=\"{4}\" y2=\"{3}\" \
             stroke=\"#ddd\"/><text x=\"{5}\" y=\"{3}\" text-anchor=\"end\">{value:.1}</text>\n",
            x(ratio),
            HEIGHT - MARGIN,
            HEIGHT - MARGIN + 18.0,
            y(value),
            WIDTH - MARGIN,
            MARGIN - 6.0,
        );
    }
    let mut front: Vec<_> = points.iter().filter(|(row, ..)| is_best(row, rows)).collect();
    front.sort_by(|a, b| a.1.total_cmp(&b.1));
    let path: Vec<_> = front.iter().map(|(_, ratio, value)| format!("{:.1},{:.1}", x(*ratio), y(*value))).collect();
    text += &format!("<polyline points=\"{}\" fill=\"none\" stroke=\"#d04030\"/>\n", path.join(" "));
    for (row, ratio, value) in &points {
        let color = match (is_best(row, rows), row.setting) {
            (_, "preset" | "exact") => "#2050d0",
            (true, _) => "#d04030",
            _ => "#888",
        };
        text += &format!(
            "<circle cx=\"{0:.1}\" cy=\"{1:.1}\" r=\"4\" fill=\"{color}\"/><text x=\"{2:.1}\" y=\"{3:.1}\" \
             fill=\"{color}\">{4} {5}</text>\n",
            x(*ratio),
            y(*value),
            x(*ratio) + 6.0,
            y(*value) - 4.0,
            row.setting,
            row.value,
        );
    }
    text + "</svg>\n"
}
