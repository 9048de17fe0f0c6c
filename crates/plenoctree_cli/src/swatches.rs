//! A palette as text and as an image.

use image::{Rgb, RgbImage};
use plenoctree::palette::Palette;

use crate::{hex, text};

/// Returns one line per color: its index, its hex code and its share of the weight.
pub fn lines(palette: &Palette) -> String {
    let line = |(index, color): (usize, &[f64; 3])| {
        let code = hex::format(hex::quantize(*color));
        format!("{index:2}  {code}  {:5.1}%\n", share(palette, index))
    };
    palette.colors.iter().enumerate().map(line).collect()
}

/// The width and height of a swatch, in pixels.
const SWATCH: u32 = 160;

/// Draws a square for every color, with its index, hex code and share of the weight.
pub fn draw(palette: &Palette) -> RgbImage {
    let mut image = RgbImage::new(SWATCH * palette.colors.len() as u32, SWATCH);
    for (index, color) in palette.colors.iter().enumerate() {
        let color = hex::quantize(*color);
        let left = SWATCH * index as u32;
        for y in 0..SWATCH {
            for x in left..left + SWATCH {
                image.put_pixel(x, y, Rgb(color));
            }
        }
        let luma = color.iter().zip([0.3, 0.59, 0.11]).map(|(c, share)| f32::from(*c) * share).sum::<f32>();
        let ink = if luma > 128.0 { [0; 3] } else { [255; 3] };
        let lines = [index.to_string(), hex::format(color), format!("{:.1}%", share(palette, index))];
        for (line, content) in lines.iter().enumerate() {
            let place = (f64::from(left + 8), 16.0 + 24.0 * line as f64);
            text::write(&mut image, content, place, 0.0, Rgb(ink));
        }
    }
    image
}

/// The width and height of a color in the small drawing, in pixels.
const SMALL: usize = 42;

/// Draws a small row of colors as SVG, with hex codes and shares of the weight below.
pub fn svg(palette: &Palette) -> String {
    let (width, height) = (SMALL * palette.colors.len(), SMALL + 24);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} \
         {height}\" font-family=\"sans-serif\" font-size=\"9\" text-anchor=\"middle\" fill=\"#808088\">\n"
    );
    for (index, color) in palette.colors.iter().enumerate() {
        let (code, left, share) = (hex::format(hex::quantize(*color)), SMALL * index, share(palette, index));
        let middle = left + SMALL / 2;
        svg += &format!(
            "<rect x=\"{left}\" width=\"{SMALL}\" height=\"{SMALL}\" fill=\"{code}\"/>\n<text x=\"{middle}\" \
             y=\"{}\">{code}</text>\n<text x=\"{middle}\" y=\"{}\">{share:.1}%</text>\n",
            SMALL + 10,
            SMALL + 21,
        );
    }
    svg + "</svg>\n"
}

/// Returns a color's weight in percent.
fn share(palette: &Palette, index: usize) -> f64 {
    100.0 * palette.weights.get(index).copied().unwrap_or(0.0)
}
