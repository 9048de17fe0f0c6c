//! Fuzzes the readers of captures with arbitrary bytes, which start like one of the formats.

#![no_main]

use libfuzzer_sys::fuzz_target;
use plenoctree_fuzz::{CaptureFile, check_capture};

fuzz_target!(|file: CaptureFile| check_capture(&file.build()));
