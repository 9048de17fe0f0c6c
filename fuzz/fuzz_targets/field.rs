//! Fuzzes the field reader with files whose framing is valid, or nearly so. See [`FieldFile`].

#![no_main]

use libfuzzer_sys::fuzz_target;
use plenoctree_fuzz::{FieldFile, check_field};

fuzz_target!(|file: FieldFile| {
    let (bytes, unpacked) = file.build();
    check_field(&bytes, Some(unpacked), &file.settings);
});
