//! Fuzzes the camera file reader with arbitrary text, and with JSON of arbitrary numbers.

#![no_main]

use libfuzzer_sys::fuzz_target;
use plenoctree_fuzz::{TransformsFile, check_transforms};

fuzz_target!(|file: TransformsFile| check_transforms(&file.text(), file.size()));
