//! A palette as text and as an image.

use image::{Rgb, RgbImage};
use plenoctree::palette::Palette;

use crate::{hex, text};

/// Returns one line per color: its index, its hex code and its share of the weight. Colors of a ramp are together, from
/// shadow to highlight, below a line with the ramp's index, name and share.
pub fn lines(palette: &Palette) -> String {
    let line = |index: usize| {
        let code = hex::format(hex::quantize(palette.colors[index]));
        format!("{index:2}  {code}  {:5.1}%\n", 100.0 * palette.share(index))
    };
    let group = |Group { name, tones }: Group| {
        let total: f64 = tones.iter().map(|tone| 100.0 * palette.share(*tone)).sum();
        let head = name.map(|name| format!("{name}, {total:.1}%\n")).unwrap_or_default();
        head + &tones.into_iter().map(line).collect::<String>()
    };
    groups(palette).into_iter().map(group).collect()
}

/// Colors that are shown together.
struct Group {
    /// The ramp's index and name, if they form one.
    name: Option<String>,
    tones: Vec<usize>,
}

/// Returns the ramps, and then all other colors together.
fn groups(palette: &Palette) -> Vec<Group> {
    let ramps = palette.ramps.iter().enumerate();
    let ramps = ramps
        .map(|(index, ramp)| Group { name: Some(format!("ramp {index}: {}", ramp.name)), tones: ramp.tones.clone() });
    let tones: Vec<usize> = (0..palette.colors.len()).filter(|tone| palette.ramp_of(*tone).is_none()).collect();
    let rest = (!tones.is_empty()).then_some(Group { name: None, tones });
    ramps.chain(rest).collect()
}

/// The width and height of a swatch, in pixels.
const SWATCH: u32 = 160;
/// The height of a ramp's name, in pixels.
const HEAD: u32 = 32;

/// Draws a square for every color, with its index, hex code and share of the weight. Every ramp has a row of its own,
/// below its name.
pub fn draw(palette: &Palette) -> RgbImage {
    let groups = groups(palette);
    let height = |group: &Group| SWATCH + if group.name.is_some() { HEAD } else { 0 };
    let most = groups.iter().map(|group| group.tones.len() as u32).max().unwrap_or(0);
    let name = groups.iter().filter_map(|group| group.name.as_deref()).map(text::width).max().unwrap_or(0);
    let width = (SWATCH * most).max(16 + name);
    let mut image = RgbImage::from_pixel(width, groups.iter().map(height).sum(), Rgb([255; 3]));
    let mut top = 0;
    for group in &groups {
        let below = top + height(group);
        if let Some(name) = &group.name {
            text::write(&mut image, name, (8, top + 8), Rgb([0; 3]));
        }
        for (column, &tone) in group.tones.iter().enumerate() {
            swatch(&mut image, palette, tone, (SWATCH * column as u32, below - SWATCH));
        }
        top = below;
    }
    image
}

fn swatch(image: &mut RgbImage, palette: &Palette, tone: usize, (left, top): (u32, u32)) {
    let color = hex::quantize(palette.colors[tone]);
    for y in top..top + SWATCH {
        for x in left..left + SWATCH {
            image.put_pixel(x, y, Rgb(color));
        }
    }
    let luma = color.iter().zip([0.3, 0.59, 0.11]).map(|(c, share)| f32::from(*c) * share).sum::<f32>();
    let ink = if luma > 128.0 { [0; 3] } else { [255; 3] };
    let lines = [tone.to_string(), hex::format(color), format!("{:.1}%", 100.0 * palette.share(tone))];
    for (line, content) in (0..).zip(&lines) {
        text::write(image, content, (left + 8, top + 8 + 24 * line), Rgb(ink));
    }
}

#[cfg(test)]
mod tests {
    use plenoctree::palette::Ramp;

    use super::*;

    /// A ramp of one color may have a long name.
    #[test]
    fn names_are_whole() {
        let mut palette = Palette::new(vec![[0.1; 3]]).unwrap();
        palette.ramps = vec![Ramp { name: "the lid of the chest".into(), tones: vec![0] }];
        let [start, end] = [0, 27].map(|letter| 8 + 16 * letter);
        let image = draw(&palette);
        let is_black = |x: u32| (0..HEAD).any(|y| image.get_pixel(x, y).0 == [0; 3]);
        assert!(image.width() >= end + 16 && (start..start + 16).any(is_black) && (end..end + 16).any(is_black));
    }
}
