//! Palettes' files: any text, and JSON of any numbers.

#![no_main]

use bevy_plenoctree_fuzz::{PaletteFile, check_palette};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|file: PaletteFile| check_palette(&file.text()));
