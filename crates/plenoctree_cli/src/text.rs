//! Text on images.

use font8x8::UnicodeFonts;
use image::{Rgb, RgbImage};

/// The width and height of a dot of a letter, in pixels.
const DOT: u32 = 2;
/// The width and height of a letter, in pixels.
pub const LETTER: u32 = 8 * DOT;

/// Writes one line, vertically centered at `y`. `anchor` is the share of the line that is left of `x`, from 0 to 1.
/// Parts outside the image are cut off.
pub fn write(image: &mut RgbImage, text: &str, (x, y): (f64, f64), anchor: f64, ink: Rgb<u8>) {
    let width = f64::from(LETTER) * text.chars().count() as f64;
    let left = x - anchor * width;
    let (left, top) = (left.round() as i64, (y - 0.5 * f64::from(LETTER)).round() as i64);
    for (column, letter) in text.chars().enumerate() {
        let glyph = font8x8::BASIC_FONTS.get(letter).unwrap_or_default();
        for dot in 0..LETTER * LETTER {
            let (dx, dy) = (dot % LETTER, dot / LETTER);
            if glyph[(dy / DOT) as usize] >> (dx / DOT) & 1 == 1 {
                let x = left + i64::from(LETTER) * column as i64 + i64::from(dx);
                let (x, y) = (u32::try_from(x), u32::try_from(top + i64::from(dy)));
                if let (Ok(x), Ok(y)) = (x, y)
                    && let Some(pixel) = image.get_pixel_mut_checked(x, y)
                {
                    *pixel = ink;
                }
            }
        }
    }
}
