//! Fuzzes the palette reader with arbitrary text, and with JSON of arbitrary numbers.

#![no_main]

use libfuzzer_sys::fuzz_target;
use plenoctree_fuzz::{PaletteFile, check_palette};

fuzz_target!(|file: PaletteFile| check_palette(&file.text()));
