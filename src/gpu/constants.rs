//! The constants that Rust and WGSL share, as a shader module that is written from the Rust ones.

use plenoctree::{Basis, MAX_DEPTH, sampling::MAX_CHANNEL};

use super::records::{BRICK, INNER, KIND, LEAF};

/// Threads of a workgroup of the sampling shader.
pub(crate) const SAMPLING_WORKGROUP: u32 = 64;
/// The most props that a view can draw: the texels between the passes name a prop in 16 bits, 0 for none, and what
/// posterizes the rest of the view counts as one more.
pub(crate) const MAX_PROPS_IN_VIEW: usize = 0xfffe;

/// WGSL for `#import bevy_plenoctree::constants`.
pub(super) fn wgsl() -> String {
    let unsigned = [
        ("KIND", KIND),
        ("BRICK", BRICK),
        ("INNER", INNER),
        ("WHOLE", LEAF),
        ("NO_LEAF", u32::MAX),
        ("MAX_DEPTH", MAX_DEPTH),
        ("SAMPLING_WORKGROUP", SAMPLING_WORKGROUP),
    ];
    let unsigned: String = unsigned.map(|(name, value)| format!("const {name}: u32 = {value}u;\n")).concat();
    let harmonics = Basis::FACTORS.map(|factor| format!("{factor:?}")).join(", ");
    format!(
        "#define_import_path bevy_plenoctree::constants\n\n{unsigned}const MAX_CHANNEL: f32 = {MAX_CHANNEL:?};\nconst \
         HARMONICS: array<f32, {}> = array({harmonics});\n",
        Basis::FACTORS.len()
    )
}
