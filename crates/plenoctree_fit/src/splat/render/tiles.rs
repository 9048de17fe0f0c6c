//! Blends projected Gaussians, tile by tile.

use glam::Vec4;

use super::project::{FAINTEST, Projected};
use crate::exponential::exp_minus;

/// Width of a tile, in pixels.
pub const TILE: usize = 16;
/// Highest opacity of a Gaussian.
const MOST_OPACITY: f32 = 0.99;
/// Transmittance below which a pixel is done.
const STOP: f32 = 1e-4;

/// A tile while it is drawn: red, green, blue and transmittance of each pixel.
struct Tile([[f32; TILE * TILE]; 4]);

/// Draws the row of tiles that starts at the line `top` of the image. `projected` is sorted from front to back.
pub fn draw_row(projected: &[Projected], top: usize, width: usize, pixels: &mut [Vec4]) {
    let lines = pixels.len() / width;
    let (low, high) = (top as f32, (top + lines) as f32);
    // Indices are less than 2^32: that many Gaussians would take 400 GB.
    let in_row: Vec<u32> = (projected.iter().zip(0u32..))
        .filter(|(gaussian, _)| {
            gaussian.center.y + gaussian.reach.y >= low && gaussian.center.y - gaussian.reach.y <= high
        })
        .map(|(_, index)| index)
        .collect();
    for left in (0..width).step_by(TILE) {
        let columns = TILE.min(width - left);
        let mut tile = Tile([[0.0; TILE * TILE], [0.0; TILE * TILE], [0.0; TILE * TILE], [1.0; TILE * TILE]]);
        let (low, high) = (left as f32, (left + columns) as f32);
        let mut drawn = 0;
        for &index in &in_row {
            let gaussian = &projected[index as usize];
            if gaussian.center.x + gaussian.reach.x < low || gaussian.center.x - gaussian.reach.x > high {
                continue;
            }
            tile.blend(gaussian, left, top, lines);
            drawn += 1;
            if drawn % 16 == 0 && tile.is_done(columns, lines) {
                break;
            }
        }
        for line in 0..lines {
            for column in 0..columns {
                let [r, g, b, through] = [0, 1, 2, 3].map(|plane: usize| tile.0[plane][line * TILE + column]);
                pixels[line * width + left + column] = Vec4::new(r, g, b, 1.0 - through);
            }
        }
    }
}

impl Tile {
    fn blend(&mut self, gaussian: &Projected, left: usize, top: usize, lines: usize) {
        let Projected { center, conic, opacity, color, reach, .. } = *gaussian;
        let local = center.y - top as f32;
        let first = (local - reach.y - 0.5).max(0.0) as usize;
        let last = (local + reach.y + 0.5).clamp(0.0, lines as f32) as usize;
        let x = left as f32 + 0.5 - center.x;
        let [reds, greens, blues, through] = &mut self.0;
        for line in first..last.max(first).min(lines) {
            let y = line as f32 + 0.5 - local;
            let row = line * TILE..(line + 1) * TILE;
            let planes = (reds[row.clone()].iter_mut().zip(&mut greens[row.clone()]))
                .zip(blues[row.clone()].iter_mut().zip(&mut through[row]));
            for (column, ((red, green), (blue, through))) in planes.enumerate() {
                let x = x + column as f32;
                let power = 0.5 * (conic.x * x * x + conic.z * y * y) + conic.y * x * y;
                let alpha = (opacity * exp_minus(power.max(0.0))).min(MOST_OPACITY);
                let alpha = if alpha >= FAINTEST && *through >= STOP { alpha } else { 0.0 };
                let weight = *through * alpha;
                *red += weight * color.x;
                *green += weight * color.y;
                *blue += weight * color.z;
                *through -= weight;
            }
        }
    }

    fn is_done(&self, columns: usize, lines: usize) -> bool {
        (0..lines).all(|line| self.0[3][line * TILE..][..columns].iter().all(|through| *through < STOP))
    }
}
