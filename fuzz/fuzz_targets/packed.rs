//! Fuzzes the reader of packed fields with sections whose checksums are valid.

#![no_main]

use libfuzzer_sys::fuzz_target;
use plenoctree_fuzz::{PackedFile, check_field};

/// The bytes of memory that a byte of a packed field may take, relative to one of an archive's arrays: a byte of the
/// tree stands for eight leaves, whose numbers may take no bits.
const DENSER: u64 = 24;

fuzz_target!(|file: PackedFile| {
    let (bytes, unpacked) = file.bytes();
    check_field(&bytes, Some(DENSER * unpacked), &file.settings);
});
