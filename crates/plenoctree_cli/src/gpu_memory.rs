//! How much GPU memory a field takes.

use plenoctree::PlenOctree;

/// Returns the number of bytes that the plugin needs on the GPU, or `None` in a build without Bevy.
#[cfg(feature = "bevy")]
pub fn bytes(field: &PlenOctree) -> Option<u64> {
    Some(bevy_plenoctree::GpuField::byte_size(field))
}

/// Returns `None`, because the number of bytes is unknown in a build without Bevy.
#[cfg(not(feature = "bevy"))]
pub fn bytes(_field: &PlenOctree) -> Option<u64> {
    None
}
