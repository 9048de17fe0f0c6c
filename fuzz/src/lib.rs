//! Checks for the file readers of `plenoctree`, and generators of files for them to read.

#![forbid(unsafe_code)]

mod cameras;
mod captures;
mod fields;
mod files;
mod message;
mod packed;
mod palettes;
mod photographs;
mod scratch;
mod settings;

pub use cameras::{TransformsFile, check_transforms};
pub use captures::{CaptureFile, check_capture};
pub use fields::check_field;
pub use files::FieldFile;
pub use packed::PackedFile;
pub use palettes::{PaletteFile, check_palette};
pub use photographs::{Photographs, check_photographs};
pub use settings::Settings;
