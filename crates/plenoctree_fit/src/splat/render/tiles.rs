//! Blends projected Gaussians, tile by tile.

use glam::{DVec3, Vec4};

use super::project::{FAINTEST, Projected};
use crate::exponential::exp_minus;

/// Width of a tile, in pixels.
pub const TILE: usize = 16;
/// Highest opacity of a Gaussian.
const MOST_OPACITY: f32 = 0.99;
/// Transmittance below which a pixel is done.
const STOP: f32 = 1e-4;

/// Pixels of a line that are drawn together, as vectors.
const TOGETHER: usize = 4;
/// More than the relative errors of a Gaussian's form and of its opacity, in float32.
const ROUNDING: f64 = 8.0 * f32::EPSILON as f64;

/// A tile while it is drawn.
struct Tile {
    /// Red, green, blue and transmittance of each pixel.
    planes: [[f32; TILE * TILE]; 4],
    /// The columns of each line between which all that is not done is: the first, and the one behind the last.
    open: [[usize; 2]; TILE],
}

/// Draws the row of tiles that starts at the line `top` of the image, from front to back. `reached` are the lines between
/// which each Gaussian is visible. `show` is called with each Gaussian in a tile and the sum of its weights there, in
/// pixels.
pub fn draw_row(
    projected: &[Projected],
    reached: &[[f32; 2]],
    top: usize,
    width: usize,
    pixels: &mut [Vec4],
    show: impl Fn(&Projected, f32),
) {
    let lines = pixels.len() / width;
    let (low, high) = (top as f32, (top + lines) as f32);
    // Depths are positive, so that their bits are in the same order. Ties are broken by the order of the file. Indices are
    // less than 2^32: that many Gaussians would take 400 GB.
    let mut order: Vec<u64> = (reached.iter().zip(projected).zip(0u64..))
        .filter(|(([first, last], _), _)| *last >= low && *first <= high)
        .map(|((_, gaussian), index)| u64::from(gaussian.depth.to_bits()) << 32 | index)
        .collect();
    order.sort_unstable();
    let gaussian_of = |key: u64| &projected[key as u32 as usize];
    let in_row: Vec<([f32; 2], &Projected)> =
        order.into_iter().map(|key| (gaussian_of(key).span(0), gaussian_of(key))).collect();
    for left in (0..width).step_by(TILE) {
        let columns = TILE.min(width - left);
        let planes = [[0.0; TILE * TILE], [0.0; TILE * TILE], [0.0; TILE * TILE], [1.0; TILE * TILE]];
        let mut tile = Tile { planes, open: [[0, columns]; TILE] };
        let (low, high) = (left as f32, (left + columns) as f32);
        let mut drawn = 0;
        for ([first, last], gaussian) in &in_row {
            if *last < low || *first > high {
                continue;
            }
            show(gaussian, tile.blend(gaussian, left, top, lines));
            drawn += 1;
            if drawn % 16 == 0 && tile.is_done(lines) {
                break;
            }
        }
        for line in 0..lines {
            for column in 0..columns {
                let [r, g, b, through] = [0, 1, 2, 3].map(|plane: usize| tile.planes[plane][line * TILE + column]);
                pixels[line * width + left + column] = Vec4::new(r, g, b, 1.0 - through);
            }
        }
    }
}

impl Tile {
    /// Blends a Gaussian behind the others, and returns the sum of its weights.
    fn blend(&mut self, gaussian: &Projected, left: usize, top: usize, lines: usize) -> f32 {
        let Projected { center, conic, opacity, color, reach, .. } = *gaussian;
        let local = center.y - top as f32;
        let first = (local - reach.y - 0.5).max(0.0) as usize;
        let last = (local + reach.y + 0.5).clamp(0.0, lines as f32) as usize;
        let x = left as f32 + 0.5 - center.x;
        let visible = Visible::new(gaussian, x);
        let [reds, greens, blues, through] = &mut self.planes;
        let mut sums = [0.0; TOGETHER];
        for line in first..last.max(first).min(lines) {
            let open = self.open[line];
            if open[0] >= open[1] {
                continue;
            }
            let y = line as f32 + 0.5 - local;
            let Some([from, to]) = visible.on_line(y, open) else { continue };
            for part in (from - from % TOGETHER..to).step_by(TOGETHER) {
                let pixels = line * TILE + part..line * TILE + part + TOGETHER;
                let planes = (reds[pixels.clone()].iter_mut().zip(&mut greens[pixels.clone()]))
                    .zip(blues[pixels.clone()].iter_mut().zip(&mut through[pixels]));
                for ((column, ((red, green), (blue, through))), sum) in planes.enumerate().zip(&mut sums) {
                    let x = x + (part + column) as f32;
                    let power = 0.5 * (conic.x * x * x + conic.z * y * y) + conic.y * x * y;
                    let alpha = (opacity * exp_minus(power.max(0.0))).min(MOST_OPACITY);
                    let alpha = if alpha >= FAINTEST && *through >= STOP { alpha } else { 0.0 };
                    let weight = *through * alpha;
                    *red += weight * color.x;
                    *green += weight * color.y;
                    *blue += weight * color.z;
                    *through -= weight;
                    *sum += weight;
                }
            }
        }
        sums.iter().sum()
    }

    /// Finds what is done, and returns whether all is.
    fn is_done(&mut self, lines: usize) -> bool {
        let [.., through] = &self.planes;
        for (line, [from, to]) in self.open[..lines].iter_mut().enumerate() {
            let is_done = |column: usize| through[line * TILE + column] < STOP;
            while from < to && is_done(*from) {
                *from += 1;
            }
            while from < to && is_done(*to - 1) {
                *to -= 1;
            }
        }
        self.open[..lines].iter().all(|[from, to]| from >= to)
    }
}

/// Where a Gaussian is visible in a tile: no pixel is left out that float32 would draw.
struct Visible {
    /// Place of the first column.
    x: f64,
    /// The form, and the square of the distance up to which it is visible.
    conic: DVec3,
    square: f64,
    /// The largest absolute place of a column.
    farthest: f64,
    /// The inverse of the form's x x.
    inverse: f64,
}

impl Visible {
    fn new(gaussian: &Projected, x: f32) -> Self {
        let (x, conic) = (f64::from(x), gaussian.conic.as_dvec3());
        let farthest = x.abs().max((x + TILE as f64).abs());
        let square = f64::from(gaussian.square) + 0.01;
        Self { x, conic, square, farthest, inverse: conic.x.recip() }
    }

    /// Returns those of the columns between `open` in which the Gaussian may be visible on a line.
    fn on_line(&self, y: f32, open: [usize; 2]) -> Option<[usize; 2]> {
        let (y, conic) = (f64::from(y), self.conic);
        if conic.x <= 0.0 {
            // It is so wide that its form is not that of an ellipse, after rounding.
            return Some(open);
        }
        // Squared distances are x x conic.x + 2 b x + c.
        let (b, c) = (conic.y * y, conic.z * y * y);
        // The terms of a long needle are much larger than their sum, and so are their rounding errors.
        let terms = conic.x * self.farthest * self.farthest + 2.0 * b.abs() * self.farthest + c;
        let discriminant = b * b - conic.x * (c - self.square - ROUNDING * terms);
        if discriminant.is_nan() || discriminant <= 0.0 {
            return None;
        }
        let (middle, half) = (-b * self.inverse - self.x, discriminant.sqrt() * self.inverse);
        // Places of columns are rounded as well.
        let margin = 1.0 + ROUNDING * self.farthest;
        // The cast rounds down, and to 0 if it is negative.
        let from = open[0].max((middle - half - margin) as usize);
        let to = open[1].min((middle + half + margin + 1.0) as usize);
        (from < to).then_some([from, to])
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, Vec2, Vec3};
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// No pixel in which a Gaussian is visible is left out, however long and thin it is and however far from the
        /// tile its center is.
        #[test]
        fn columns_hold_all_that_is_visible(
            lengths in (-0.6f64..7.0, -0.6f64..3.0),
            turn in 0.0f64..6.3,
            along in -3.0f64..3.0,
            across in -3.0f64..3.0,
            opacity in 0.004f32..1.0,
        ) {
            let [long, wide] = [lengths.0, lengths.1].map(|length| 10f64.powf(length));
            let [axis, normal] = [DVec2::from_angle(turn), DVec2::from_angle(turn).perp()];
            let center = (8.0 + along * long * axis + across * wide * normal).as_vec2();
            let entry = |a: usize, b: usize| {
                (axis[a] * axis[b] / (long * long) + normal[a] * normal[b] / (wide * wide)) as f32
            };
            let conic = Vec3::new(entry(0, 0), entry(0, 1), entry(1, 1));
            let square = 2.0 * (opacity / FAINTEST).ln();
            let (depth, color, reach) = (1.0, Vec3::ONE, Vec2::splat(f32::MAX));
            let gaussian = Projected { index: 0, depth, center, conic, opacity, color, square, reach };
            let x = 0.5 - center.x;
            let visible = Visible::new(&gaussian, x);
            for line in 0..TILE {
                let y = line as f32 + 0.5 - center.y;
                let [from, to] = visible.on_line(y, [0, TILE]).unwrap_or_default();
                for column in (0..TILE).filter(|column| !(from..to).contains(column)) {
                    let x = x + column as f32;
                    let power = 0.5 * (conic.x * x * x + conic.z * y * y) + conic.y * x * y;
                    prop_assert!(opacity * exp_minus(power.max(0.0)) < FAINTEST, "{line} {column} {power}");
                }
            }
        }
    }

    /// What is done is no longer looked at: the columns at either end, but not those between others that are not done.
    #[test]
    fn columns_that_are_done_are_left_out() {
        let mut planes = [[0.0; TILE * TILE]; 4];
        planes[3][TILE + 3] = 1.0;
        planes[3][TILE + 6] = 1.0;
        let mut tile = Tile { planes, open: [[0, TILE]; TILE] };
        assert!(!tile.is_done(TILE));
        for (line, [from, to]) in tile.open.into_iter().enumerate() {
            assert!(if line == 1 { [from, to] == [3, 7] } else { from >= to });
        }
        tile.planes[3] = [0.0; TILE * TILE];
        assert!(tile.is_done(TILE));
    }
}
