//! Text on images.

use font8x8::UnicodeFonts;
use image::{Rgb, RgbImage};

/// The width and height of a dot of a letter, in pixels.
const DOT: u32 = 2;
/// The width and height of a letter, in pixels.
const LETTER: u32 = 8 * DOT;

/// Returns the width of a line, in pixels.
pub fn width(text: &str) -> u32 {
    LETTER * text.chars().count() as u32
}

/// Writes one line that starts at `left` and `top`. Parts outside the image are cut off.
pub fn write(image: &mut RgbImage, text: &str, (left, top): (u32, u32), ink: Rgb<u8>) {
    for (column, letter) in (0..).zip(text.chars()) {
        let glyph = font8x8::BASIC_FONTS.get(letter).unwrap_or_default();
        for dot in 0..LETTER * LETTER {
            let (dx, dy) = (dot % LETTER, dot / LETTER);
            if glyph[(dy / DOT) as usize] >> (dx / DOT) & 1 == 1
                && let Some(pixel) = image.get_pixel_mut_checked(left + LETTER * column + dx, top + dy)
            {
                *pixel = ink;
            }
        }
    }
}
