//! Checks for the palette reader.

use arbitrary::Arbitrary;
use plenoctree::palette::Palette;

use crate::{message::check_message, scratch::Scratch};

/// The content of a palette file.
#[derive(Arbitrary, Debug)]
pub enum PaletteFile<'a> {
    Text(&'a [u8]),
    Numbers { colors: Vec<[f64; 3]>, weights: Option<Vec<f64>> },
    Shown { colors: Vec<[f64; 3]>, shown: Vec<[f64; 3]> },
}

impl PaletteFile<'_> {
    pub fn text(&self) -> Vec<u8> {
        match self {
            Self::Text(text) => text.to_vec(),
            Self::Numbers { colors, weights: None } => format!(r#"{{"colors": {colors:?}}}"#).into_bytes(),
            Self::Shown { colors, shown } => format!(r#"{{"colors": {colors:?}, "shown": {shown:?}}}"#).into_bytes(),
            Self::Numbers { colors, weights: Some(weights) } => {
                format!(r#"{{"colors": {colors:?}, "weights": {weights:?}}}"#).into_bytes()
            }
        }
    }
}

/// Checks that a file gives a palette that is the same after it is written and read again, or a valid error message.
/// Reading from memory must give the same result as reading from a file.
pub fn check_palette(text: &[u8]) {
    let folder = Scratch::new("palette");
    let file = folder.file("palette.json", text);
    let palette = match Palette::read(&file) {
        Ok(palette) => palette,
        Err(error) => {
            check_message(&error, text.len());
            assert!(serde_json::from_slice::<Palette>(text).is_err());
            return;
        }
    };
    assert_eq!(serde_json::from_slice::<Palette>(text).expect("a file that was read"), palette);
    palette.validate().expect("a palette that a file may hold");
    palette.write(&file).expect("what was read can be written");
    assert_eq!(Palette::read(&file).expect("what was written can be read"), palette);
}
