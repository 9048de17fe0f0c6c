//! Files: pictures and palette.

use std::path::Path;

use bevy_plenoctree::Palette;
use image::{Rgb, RgbImage};

use crate::{Result, text};

/// The pictures of one view.
pub struct Pictures {
    pub original: RgbImage,
    pub posterized: RgbImage,
    pub recolored: Option<RgbImage>,
}

/// Writes a view's pictures and returns the names of the files, the original's first.
pub fn write_frame(pictures: &Pictures, index: usize, folder: &Path) -> Result<Vec<String>> {
    let kinds = [
        ("original", Some(&pictures.original)),
        ("posterized", Some(&pictures.posterized)),
        ("recolored", pictures.recolored.as_ref()),
    ];
    let mut names = Vec::new();
    for (kind, picture) in kinds {
        if let Some(picture) = picture {
            let name = format!("frame_{index:03}.{kind}.png");
            let path = folder.join(&name);
            picture.save(&path).map_err(|error| format!("{}: {error}", path.display()))?;
            names.push(name);
        }
    }
    Ok(names)
}

/// Writes `palette.json` and `palette.png`.
pub fn write_palette(palette: &Palette, folder: &Path) -> Result<()> {
    palette.write(folder.join("palette.json"))?;
    let path = folder.join("palette.png");
    swatches(palette).save(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    Ok(())
}

/// Pixels a side of a swatch.
const SWATCH: u32 = 160;

/// A square for every color, with its index, hex code and share of the weight.
fn swatches(palette: &Palette) -> RgbImage {
    let mut picture = RgbImage::new(SWATCH * palette.colors.len() as u32, SWATCH);
    for (index, color) in palette.colors.iter().enumerate() {
        let color = color.map(|c| (255.0 * c.clamp(0.0, 1.0)).round() as u8);
        let left = SWATCH * index as u32;
        for y in 0..SWATCH {
            for x in left..left + SWATCH {
                picture.put_pixel(x, y, Rgb(color));
            }
        }
        let luma = color.iter().zip([0.3, 0.59, 0.11]).map(|(c, share)| f32::from(*c) * share).sum::<f32>();
        let ink = if luma > 128.0 { [0; 3] } else { [255; 3] };
        let [r, g, b] = color;
        let share = 100.0 * palette.weights.get(index).copied().unwrap_or(0.0);
        let lines = [index.to_string(), format!("#{r:02x}{g:02x}{b:02x}"), format!("{share:.1}%")];
        for (line, content) in lines.iter().enumerate() {
            let place = (f64::from(left + 8), 16.0 + 24.0 * line as f64);
            text::write(&mut picture, content, place, 0.0, Rgb(ink));
        }
    }
    picture
}
