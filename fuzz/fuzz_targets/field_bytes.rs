//! Any bytes as a PlenOctree file.

#![no_main]

use bevy_plenoctree_fuzz::{Settings, check_field};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|input: (Settings, &[u8])| {
    let (settings, bytes) = input;
    check_field(bytes, None, &settings);
});
