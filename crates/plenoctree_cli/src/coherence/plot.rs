//! Plots the differences over the frames, in `coherence.png`.

use image::{Rgb, RgbImage};

use super::series::{COLUMNS, Series};
use crate::text::{LETTER, write};

const SIZE: (u32, u32) = (1280, 760);
/// The edges of the plotting area, in pixels.
const LEFT: f64 = 130.0;
const RIGHT: f64 = 1240.0;
const TOP: f64 = 210.0;
const BOTTOM: f64 = 690.0;

const INK: Rgb<u8> = Rgb([40, 40, 48]);
const FAINT: Rgb<u8> = Rgb([226, 226, 230]);

/// The style of a column's line.
struct Style {
    label: &'static str,
    color: Rgb<u8>,
    dashed: bool,
}

/// The styles in the order of [`COLUMNS`]. Their colors are distinct for readers who cannot tell red from green.
const STYLES: [Style; COLUMNS.len()] = [
    Style { label: "as trained", color: Rgb([130, 130, 136]), dashed: false },
    Style { label: "field's palette", color: Rgb([0, 94, 178]), dashed: false },
    Style { label: "frame's palette", color: Rgb([213, 94, 0]), dashed: false },
    Style { label: "field's, recolored", color: Rgb([86, 160, 226]), dashed: true },
    Style { label: "frame's, recolored", color: Rgb([236, 158, 60]), dashed: true },
];

/// Draws a line per column over the frames, with axes and a legend that shows the means.
pub fn draw(series: &Series, name: &str) -> RgbImage {
    let mut image = RgbImage::from_pixel(SIZE.0, SIZE.1, Rgb([255; 3]));
    let center = 0.5 * f64::from(SIZE.0);
    let title = format!("Mean absolute difference of neighboring frames, {name}");
    write(&mut image, &title, (center, 30.0), 0.5, INK);
    legend(&mut image, series);

    let most = (0..COLUMNS.len()).map(|column| series.largest(column).1).fold(1e-6, f64::max);
    let step = tick_step(most, 6.0);
    let top = (most / step).ceil() * step;
    let y = |value: f64| BOTTOM - (BOTTOM - TOP) * value / top;
    // Leave half a frame on either side, so that a single pair has a place too.
    let (first, last) = (0.5, series.len() as f64 + 0.5);
    let x = |frame: f64| LEFT + (RIGHT - LEFT) * (frame - first) / (last - first);

    for tick in 0..=(top / step).round() as usize {
        let value = step * tick as f64;
        line(&mut image, (LEFT, y(value)), (RIGHT, y(value)), 1.0, FAINT);
        let decimals = (-step.log10().floor()).max(0.0) as usize;
        write(&mut image, &format!("{value:.decimals$}"), (LEFT - 14.0, y(value)), 1.0, INK);
    }
    let frames = tick_step(series.len() as f64, 10.0).max(1.0) as usize;
    for frame in (1..=series.len()).filter(|frame| frame % frames == 0) {
        let x = x(frame as f64);
        line(&mut image, (x, BOTTOM), (x, BOTTOM + 6.0), 1.5, INK);
        write(&mut image, &frame.to_string(), (x, BOTTOM + 22.0), 0.5, INK);
    }
    line(&mut image, (LEFT, TOP), (LEFT, BOTTOM), 1.5, INK);
    line(&mut image, (LEFT, BOTTOM), (RIGHT, BOTTOM), 1.5, INK);
    let below = 0.5 * (LEFT + RIGHT);
    write(&mut image, "frame, over a turn of 90 degrees", (below, BOTTOM + 50.0), 0.5, INK);

    // Draw the most important lines last, on top.
    for column in (0..COLUMNS.len()).rev() {
        let points: Vec<_> = series.column(column).map(|(frame, value)| (x(frame as f64), y(value))).collect();
        curve(&mut image, &points, &STYLES[column]);
    }
    image
}

/// Draws the names of the lines, with their means and largest values.
fn legend(image: &mut RgbImage, series: &Series) {
    let letter = f64::from(LETTER);
    let (sample, label, mean, largest) = (LEFT + 130.0, LEFT + 210.0, LEFT + 640.0, LEFT + 800.0);
    let mut top = 62.0;
    write(image, "mean", (mean, top), 1.0, INK);
    write(image, "largest", (largest, top), 1.0, INK);
    for (column, style) in STYLES.iter().enumerate() {
        top += 1.4 * letter;
        curve(image, &[(sample, top), (sample + 56.0, top)], style);
        write(image, style.label, (label, top), 0.0, INK);
        write(image, &format!("{:.4}", series.mean(column)), (mean, top), 1.0, INK);
        write(image, &format!("{:.4}", series.largest(column).1), (largest, top), 1.0, INK);
    }
}

/// Returns the distance between ticks, 1, 2 or 5 times a power of ten, so that there are at most `count` up to `most`.
fn tick_step(most: f64, count: f64) -> f64 {
    let least = most / count;
    let power = 10f64.powf(least.log10().floor());
    [1.0, 2.0, 5.0, 10.0].map(|factor| factor * power).into_iter().find(|step| *step >= least).unwrap_or(least)
}

/// Draws a line through points, or a dot if there is only one.
fn curve(image: &mut RgbImage, points: &[(f64, f64)], style: &Style) {
    const WIDTH: f64 = 2.6;
    if let [point] = points {
        line(image, *point, *point, 3.0 * WIDTH, style.color);
    }
    // Dashes continue around bends.
    const DASH: f64 = 9.0;
    let mut walked = 0.0;
    for pair in points.windows(2) {
        let ((x0, y0), (x1, y1)) = (pair[0], pair[1]);
        let length = (x1 - x0).hypot(y1 - y0);
        let at = |walk: f64| (x0 + (x1 - x0) * walk / length, y0 + (y1 - y0) * walk / length);
        if !style.dashed {
            line(image, (x0, y0), (x1, y1), WIDTH, style.color);
            continue;
        }
        let mut begin = 0.0;
        while begin < length {
            let dash = ((walked + begin) / DASH).floor();
            let end = ((dash + 1.0) * DASH - walked).max(begin + 1e-3).min(length);
            if dash % 2.0 == 0.0 {
                line(image, at(begin), at(end), WIDTH, style.color);
            }
            begin = end;
        }
        walked += length;
    }
}

/// Draws a straight line with round ends and smooth edges. Points are in pixels from the image's top left corner.
fn line(image: &mut RgbImage, (x0, y0): (f64, f64), (x1, y1): (f64, f64), width: f64, ink: Rgb<u8>) {
    let reach = 0.5 * width + 1.0;
    let range = |a: f64, b: f64, most: u32| {
        let clamp = |at: f64| at.clamp(0.0, f64::from(most)) as u32;
        clamp(a.min(b) - reach)..clamp(a.max(b) + reach + 1.0)
    };
    let (dx, dy) = (x1 - x0, y1 - y0);
    let squared = (dx * dx + dy * dy).max(f64::MIN_POSITIVE);
    for y in range(y0, y1, image.height()) {
        for x in range(x0, x1, image.width()) {
            let (px, py) = (f64::from(x) + 0.5 - x0, f64::from(y) + 0.5 - y0);
            let along = ((px * dx + py * dy) / squared).clamp(0.0, 1.0);
            let distance = (px - along * dx).hypot(py - along * dy);
            let cover = (0.5 * width + 0.5 - distance).clamp(0.0, 1.0);
            let pixel = image.get_pixel_mut(x, y);
            for (below, above) in pixel.0.iter_mut().zip(ink.0) {
                *below = (f64::from(*below) + cover * (f64::from(above) - f64::from(*below))).round() as u8;
            }
        }
    }
}
