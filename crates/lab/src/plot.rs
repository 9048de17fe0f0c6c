//! Plots as SVG.

use std::fmt::Write;

const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 420.0;
/// The edges of the plotting area, in pixels.
const LEFT: f64 = 70.0;
const RIGHT: f64 = WIDTH - 20.0;
const TOP: f64 = 44.0;
const BOTTOM: f64 = HEIGHT - 54.0;
/// The height of a line of the legend, in pixels.
const LEGEND: f64 = 18.0;

/// Line colors that are distinguishable with red-green color blindness.
pub const COLORS: [&str; 6] = ["#828288", "#005eb2", "#d55e00", "#009e73", "#cc79a7", "#8a6d00"];

/// A line of a plot.
pub struct Line {
    /// Its name in the legend.
    pub label: String,
    /// Its color, one of [`COLORS`].
    pub color: &'static str,
    /// Whether it is dashed.
    pub dashed: bool,
    /// Its points: x and y.
    pub points: Vec<(f64, f64)>,
}

/// A point with a name.
pub struct Mark {
    /// Its x and y.
    pub at: (f64, f64),
    /// Its name, next to it.
    pub label: String,
    /// Its color, one of [`COLORS`].
    pub color: &'static str,
}

/// A plot of lines and marks over a common x axis.
pub struct Plot<'a> {
    /// Its title.
    pub title: &'a str,
    /// The name of the x axis.
    pub x: &'a str,
    /// The name of the y axis.
    pub y: &'a str,
    /// The lines, which a legend names.
    pub lines: &'a [Line],
    /// The marks.
    pub marks: &'a [Mark],
    /// Whether the y axis starts at 0, also if no value is near it.
    pub from_zero: bool,
}

/// Draws lines. The y axis starts at 0. `title`, `x` and `y` name the plot and its axes.
pub fn lines(title: &str, x: &str, y: &str, lines: &[Line]) -> String {
    Plot { title, x, y, lines, marks: &[], from_zero: true }.svg()
}

impl Plot<'_> {
    /// Draws the plot.
    pub fn svg(&self) -> String {
        let Self { title, x, y, lines, marks, from_zero } = self;
        let points =
            || lines.iter().flat_map(|line| line.points.iter().copied()).chain(marks.iter().map(|mark| mark.at));
        let range = |of: fn((f64, f64)) -> f64| {
            points().map(of).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), value| (a.min(value), b.max(value)))
        };
        let (first, last) = range(|point| point.0);
        let (first, last) = match last - first {
            width if width > 0.0 => (first, last),
            0.0 => (first - 0.5, first + 0.5),
            _ => (0.0, 1.0),
        };
        let (low, high) = range(|point| point.1);
        let low = if *from_zero || !low.is_finite() { 0.0 } else { low };
        let step = tick_step((high - low).max(1e-9), 6.0);
        let bottom = (low / step).floor() * step;
        let top = ((high.max(low) / step).ceil() * step).max(bottom + step);
        let at_x = |value: f64| LEFT + (RIGHT - LEFT) * (value - first) / (last - first);
        let at_y = |value: f64| BOTTOM - (BOTTOM - TOP) * (value - bottom) / (top - bottom);

        let height = HEIGHT + LEGEND * lines.len() as f64;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{height}\" viewBox=\"0 0 {WIDTH} \
             {height}\" font-family=\"sans-serif\" font-size=\"12\" fill=\"#28282f\">\n<rect width=\"100%\" \
             height=\"100%\" fill=\"white\"/>\n"
        );
        text(&mut svg, (LEFT, 15.0), "start", 15, title);
        text(&mut svg, (0.5 * (LEFT + RIGHT), HEIGHT - 12.0), "middle", 12, x);
        text(&mut svg, (8.0, TOP - 14.0), "start", 12, y);
        for tick in 0..=((top - bottom) / step).round() as usize {
            let value = bottom + step * tick as f64;
            rule(&mut svg, (LEFT, at_y(value)), (RIGHT, at_y(value)));
            text(&mut svg, (LEFT - 8.0, at_y(value) + 4.0), "end", 12, &label(value, step));
        }
        let step = tick_step(last - first, 10.0);
        for tick in (first / step).ceil() as i64..=(last / step).floor() as i64 {
            let value = step * tick as f64;
            text(&mut svg, (at_x(value), BOTTOM + 18.0), "middle", 12, &label(value, step));
        }
        for (index, line) in lines.iter().enumerate() {
            let points: Vec<_> = line.points.iter().map(|p| format!("{:.1},{:.1}", at_x(p.0), at_y(p.1))).collect();
            curve(&mut svg, &points.join(" "), line);
            let y = HEIGHT + LEGEND * index as f64;
            curve(&mut svg, &format!("{LEFT},{y} {},{y}", LEFT + 36.0), line);
            text(&mut svg, (LEFT + 46.0, y + 4.0), "start", 12, &line.label);
        }
        for Mark { at, label, color } in *marks {
            let (x, y) = (at_x(at.0), at_y(at.1));
            let _ = writeln!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"{color}\"/>");
            // Toward the middle, so that the name stays in the frame.
            let (x, anchor) = if x < 0.5 * WIDTH { (x + 6.0, "start") } else { (x - 6.0, "end") };
            text(&mut svg, (x, y - 4.0), anchor, 9, label);
        }
        svg + "</svg>\n"
    }
}

/// Escapes text for XML and HTML.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

fn text(svg: &mut String, (x, y): (f64, f64), anchor: &str, size: u32, content: &str) {
    let content = escape(content);
    let _ =
        writeln!(svg, "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" font-size=\"{size}\">{content}</text>");
}

fn rule(svg: &mut String, (x0, y0): (f64, f64), (x1, y1): (f64, f64)) {
    let _ = writeln!(svg, "<path d=\"M{x0:.1} {y0:.1}L{x1:.1} {y1:.1}\" stroke=\"#e2e2e6\"/>");
}

fn curve(svg: &mut String, points: &str, line: &Line) {
    let dashes = if line.dashed { " stroke-dasharray=\"6 5\"" } else { "" };
    let _ = writeln!(
        svg,
        "<polyline points=\"{points}\" fill=\"none\" stroke=\"{}\" stroke-width=\"2\" stroke-linejoin=\"round\" \
         stroke-linecap=\"round\"{dashes}/>",
        line.color
    );
}

/// Returns a tick's value with the decimals that its step needs.
fn label(value: f64, step: f64) -> String {
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    format!("{value:.decimals$}")
}

/// Returns the distance between ticks, 1, 2 or 5 times a power of ten, so that there are at most `count` up to `most`.
fn tick_step(most: f64, count: f64) -> f64 {
    let least = most / count;
    let power = 10f64.powf(least.log10().floor());
    [1.0, 2.0, 5.0, 10.0].map(|factor| factor * power).into_iter().find(|step| *step >= least).unwrap_or(least)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// For any points, the whole plot is inside its frame, and markup in names is escaped.
    #[test]
    fn plots_stay_in_their_frame() {
        for points in [vec![], vec![(3.0, 0.0)], vec![(0.0, 1e-7), (1.0, 3e-7)], vec![(0.0, 900.0), (50.0, 0.0)]] {
            let line = Line { label: "a < b".into(), color: COLORS[1], dashed: true, points };
            let marks: Vec<_> =
                line.points.iter().map(|at| Mark { at: *at, label: "b < c".into(), color: COLORS[0] }).collect();
            let svg = [true, false].map(|from_zero| {
                Plot { title: "title", x: "x", y: "y", lines: std::slice::from_ref(&line), marks: &marks, from_zero }
                    .svg()
            });
            let svg = svg.concat();
            assert_eq!(svg.matches("b &lt; c").count(), 2 * marks.len());
            assert!(svg.contains("a &lt; b") && !svg.contains("NaN") && !svg.contains("inf"), "{svg}");
            for points in svg.lines().filter_map(|line| line.strip_prefix("<polyline points=\"")) {
                let points = points.split('"').next().unwrap();
                for number in points.split([' ', ',']).filter(|number| !number.is_empty()) {
                    assert!((0.0..=WIDTH).contains(&number.parse::<f64>().unwrap()), "{points}");
                }
            }
        }
    }

    #[test]
    fn steps_of_ticks_are_round() {
        assert_eq!([0.4, 7.0, 0.012].map(|most| tick_step(most, 6.0)), [0.1, 2.0, 0.002]);
    }
}
