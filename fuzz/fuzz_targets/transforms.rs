//! Camera files: any text, and JSON of any numbers.

#![no_main]

use bevy_plenoctree_fuzz::{TransformsFile, check_transforms};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|file: TransformsFile| check_transforms(&file.text(), file.size()));
