//! Which pixels of a picture over white show the prop.

use image::RgbImage;

/// The level of the darkest channel from which a pixel is background.
const BACKGROUND: u8 = 248;
/// Gaps up to this many pixels on either side are filled, and then lines up to this many are removed.
const FILLED: u32 = 4;
const REMOVED: u32 = 2;

/// Returns which pixels show the prop, row by row, without specks and including small gaps.
pub fn mask(original: &RgbImage) -> Vec<bool> {
    let (width, height) = original.dimensions();
    let mut mask: Vec<bool> =
        original.pixels().map(|pixel| pixel.0.iter().any(|channel| *channel < BACKGROUND)).collect();
    for (radius, value) in [(FILLED, true), (FILLED, false), (REMOVED, false), (REMOVED, true)] {
        mask = spread(&mask, (width as usize, height as usize), radius as usize, value);
    }
    mask
}

/// Returns the mask in which `value` spreads to all pixels up to a radius away in both directions.
fn spread(mask: &[bool], (width, height): (usize, usize), radius: usize, value: bool) -> Vec<bool> {
    let around = |at: usize, length: usize| at.saturating_sub(radius)..(at + radius + 1).min(length);
    let along_rows: Vec<bool> = (0..mask.len())
        .map(|pixel| (around(pixel % width, width).any(|x| mask[pixel / width * width + x] == value)) == value)
        .collect();
    (0..mask.len())
        .map(|pixel| (around(pixel / width, height).any(|y| along_rows[y * width + pixel % width] == value)) == value)
        .collect()
}

#[cfg(test)]
mod tests {
    use image::Rgb;

    use super::*;

    /// A square keeps its size, a small hole in it is filled, and a speck is left out.
    #[test]
    fn specks_and_holes_do_not_count() {
        let is_dark =
            |x: u32, y: u32| (10..40).contains(&x) && (10..40).contains(&y) && (x, y) != (20, 20) || (x, y) == (60, 60);
        let picture = RgbImage::from_fn(80, 80, |x, y| Rgb(if is_dark(x, y) { [250, 40, 40] } else { [255; 3] }));
        let mask = mask(&picture);
        assert_eq!(mask.iter().filter(|inside| **inside).count(), 30 * 30);
        assert!(mask[20 * 80 + 20] && !mask[60 * 80 + 60]);
    }
}
