//! Writes files, with errors that name them.

use std::{fs, path::Path};

use image::{ImageBuffer, PixelWithColorType};

use crate::result::Result;

/// Creates a folder and its parents, unless they exist.
pub fn create_folder(path: &Path) -> Result {
    Ok(fs::create_dir_all(path).map_err(|error| format!("{}: cannot be created: {error}", path.display()))?)
}

/// Writes a text file, replacing an existing one.
pub fn write_text(path: &Path, text: &str) -> Result {
    Ok(fs::write(path, text).map_err(|error| format!("{}: {error}", path.display()))?)
}

/// Writes an image in the format of its extension, replacing an existing file.
pub fn write_image<P>(path: &Path, image: &ImageBuffer<P, Vec<u8>>) -> Result
where
    P: PixelWithColorType<Subpixel = u8>,
{
    Ok(image.save(path).map_err(|error| format!("{}: {error}", path.display()))?)
}
