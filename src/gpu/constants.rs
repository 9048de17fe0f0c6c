//! Constants that Rust and WGSL share, as a shader module generated from the Rust values.

use plenoctree::{Basis, MAX_DEPTH, sampling::MAX_CHANNEL};

use super::records::{BRICK, INNER, KIND, LEAF};

/// The number of threads in a workgroup of the sampling shader.
pub(crate) const SAMPLING_WORKGROUP: u32 = 64;
/// The maximum number of props that a camera draws. If it sees more, it draws the nearest ones, and an error is logged.
// Textures store the owner of a pixel in 16 bits: 0 means none, and one value is reserved for the posterized view.
pub const MAX_PROPS_IN_VIEW: usize = 0xfffe;

/// Returns the WGSL source of the module `bevy_plenoctree::constants`.
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

#[cfg(test)]
mod tests {
    use naga::Literal;

    use super::*;
    use crate::tests::layouts::{constant, parse};

    #[test]
    fn shaders_find_every_constant() {
        let module = parse(&wgsl().replace("#define_import_path bevy_plenoctree::constants", ""));
        let found = ["KIND", "BRICK", "INNER", "WHOLE", "NO_LEAF", "MAX_DEPTH", "SAMPLING_WORKGROUP"];
        let expected = [KIND, BRICK, INNER, LEAF, u32::MAX, MAX_DEPTH, SAMPLING_WORKGROUP];
        assert_eq!(found.map(|name| constant(&module, name)), expected.map(|value| Some(Literal::U32(value))));
        assert_eq!(constant(&module, "MAX_CHANNEL"), Some(Literal::F32(MAX_CHANNEL as f32)));
    }
}
