//! PlenOctree files whose framing is sound, or nearly: see [`FieldFile`].

#![no_main]

use bevy_plenoctree_fuzz::{FieldFile, check_field};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|file: FieldFile| {
    let (bytes, unpacked) = file.build();
    check_field(&bytes, Some(unpacked), &file.settings);
});
