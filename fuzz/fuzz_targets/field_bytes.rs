//! Fuzzes the field reader with arbitrary bytes.

#![no_main]

use libfuzzer_sys::fuzz_target;
use plenoctree_fuzz::{Settings, check_field};

fuzz_target!(|input: (Settings, &[u8])| {
    let (settings, bytes) = input;
    check_field(bytes, None, &settings);
});
