//! Writes the images and the palette.

use std::path::Path;

use image::RgbImage;
use plenoctree::palette::Palette;

use crate::{files, result::Result, swatches};

/// The images of one view.
pub struct Views {
    /// As trained.
    pub original: RgbImage,
    /// Posterized with the field's palette.
    pub posterized: RgbImage,
    /// Posterized and recolored.
    pub recolored: Option<RgbImage>,
}

/// Writes the images of a view and returns the names of their files, the original first.
pub fn write_frame(views: &Views, index: usize, folder: &Path) -> Result<Vec<String>> {
    let kinds = [
        ("original", Some(&views.original)),
        ("posterized", Some(&views.posterized)),
        ("recolored", views.recolored.as_ref()),
    ];
    let mut names = Vec::new();
    for (kind, image) in kinds {
        if let Some(image) = image {
            let name = format!("frame_{index:03}.{kind}.png");
            files::write_image(&folder.join(&name), image)?;
            names.push(name);
        }
    }
    Ok(names)
}

/// Writes `palette.json` and `palette.png`.
pub fn write_palette(palette: &Palette, folder: &Path) -> Result {
    palette.write(folder.join("palette.json"))?;
    files::write_image(&folder.join("palette.png"), &swatches::draw(palette))
}
