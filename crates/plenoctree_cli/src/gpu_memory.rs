//! How much GPU memory a field takes.

use plenoctree::PlenOctree;

/// Bytes that the plugin needs on the GPU; `None` in a build without Bevy, which cannot know.
#[cfg(feature = "bevy")]
pub fn bytes(field: &PlenOctree) -> Option<u64> {
    Some(bevy_plenoctree::GpuField::byte_size(field))
}

/// Bytes that the plugin needs on the GPU: unknown in a build without Bevy.
#[cfg(not(feature = "bevy"))]
pub fn bytes(_field: &PlenOctree) -> Option<u64> {
    None
}
