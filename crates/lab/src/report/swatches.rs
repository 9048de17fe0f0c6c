//! A palette as a small drawing.

use plenoctree::palette::Palette;
use plenoctree_cli::hex;

/// The width and height of a color in pixels.
const SMALL: usize = 42;

/// Draws a small row of colors as SVG, with hex codes and shares of the weight below.
pub fn svg(palette: &Palette) -> String {
    let (width, height) = (SMALL * palette.colors.len(), SMALL + 24);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} \
         {height}\" font-family=\"sans-serif\" font-size=\"9\" text-anchor=\"middle\" fill=\"#808088\">\n"
    );
    for (index, color) in palette.colors.iter().enumerate() {
        let (code, left, share) = (hex::format(hex::quantize(*color)), SMALL * index, 100.0 * palette.share(index));
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
