//! Writes the images and the palette.

use std::path::{Path, PathBuf};

use image::RgbImage;
use plenoctree::palette::Palette;

use crate::{files, result::Result, swatches};

/// Writes the images of a view, named by their kinds, and returns the names of their files.
pub fn write_frame(images: &[(&str, RgbImage)], index: usize, folder: &Path) -> Result<Vec<String>> {
    let write = |(kind, image): &(&str, RgbImage)| -> Result<String> {
        let name = format!("frame_{index:03}.{kind}.png");
        files::write_image(&folder.join(&name), image)?;
        Ok(name)
    };
    images.iter().map(write).collect()
}

/// The name of the palette.
pub const PALETTE: &str = "palette.json";

/// The names of the files that no view has one of.
const SINGLE: [&str; 3] = [PALETTE, "palette.png", "report.json"];

/// Returns whether a file of this name may be written.
pub fn writes(name: &str) -> bool {
    SINGLE.contains(&name) || is_of_frame(name)
}

/// Returns the paths of the files that no view has one of, but for a palette that was read from there.
pub fn single(folder: &Path, read_from: Option<&Path>) -> Vec<PathBuf> {
    let paths = SINGLE.map(|name| folder.join(name));
    paths.into_iter().filter(|path| !read_from.is_some_and(|from| files::is_same(from, path))).collect()
}

/// Returns whether this is a name of an image of a view.
pub fn is_of_frame(name: &str) -> bool {
    let Some((index, kind)) = name.strip_prefix("frame_").and_then(|name| name.split_once('.')) else { return false };
    let is_kind = ["original.png", "posterized.png", "recolored.png"].contains(&kind);
    is_kind && index.bytes().all(|byte| byte.is_ascii_digit())
}

/// Writes `palette.json`, unless the palette was read from there, and `palette.png`.
pub fn write_palette(palette: &Palette, read_from: Option<&Path>, folder: &Path) -> Result {
    let path = folder.join(PALETTE);
    if !read_from.is_some_and(|from| files::is_same(from, &path)) {
        files::keep_former_palette(&path, Some(palette))?;
        palette.write(path)?;
    }
    files::write_image(&folder.join("palette.png"), &swatches::draw(palette))
}
