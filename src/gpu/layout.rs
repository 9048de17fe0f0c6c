//! The layout of fields' bind groups, and what pipelines know of a field.

use bevy::{
    render::render_resource::{
        BindGroupLayoutDescriptor, BindGroupLayoutEntries, ShaderStages, ShaderType, TextureFormat, TextureSampleType,
        binding_types::{texture_2d_array, uniform_buffer},
    },
    shader::ShaderDefVal,
};

use plenoctree::Activation;

use super::payload::Payload;

/// The format of densities that are not packed.
pub(super) const DENSITIES: TextureFormat = TextureFormat::R32Uint;
/// The format of the densities of packed fields: indices of those with which the codebook begins.
pub(super) const PACKED_DENSITIES: TextureFormat = TextureFormat::R8Uint;
/// The format of records, and of coefficients that are not packed.
pub(super) const WORDS: TextureFormat = TextureFormat::Rgba32Uint;
/// The format of the leaves of packed fields, and of their codebook.
pub(super) const PACKED_WORDS: TextureFormat = TextureFormat::Rg32Uint;

/// The properties of a field that pipelines are specialized for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct FieldShape {
    pub payload: Payload,
    pub activation: Activation,
    /// How many levels of child records there are below the table.
    pub inner_levels: u32,
}

/// The properties of a field that all pipelines that march through it are specialized for. Others also depend on how
/// radiance is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct TreeShape {
    /// How many levels of child records there are below the table.
    inner_levels: u32,
    /// Whether densities and coefficients have the formats of packed fields.
    has_codebook: bool,
}

impl From<FieldShape> for TreeShape {
    fn from(shape: FieldShape) -> Self {
        Self { inner_levels: shape.inner_levels, has_codebook: shape.payload.has_codebook }
    }
}

/// Matches `Field` in `octree.wgsl`.
#[cfg_attr(test, derive(bevy::reflect::Reflect))]
#[derive(Clone, Copy, ShaderType)]
pub(super) struct FieldUniform {
    pub depth: u32,
    pub table_level: u32,
    pub row: u32,
    pub record_rows: u32,
    pub density_rows: u32,
    pub coefficient_rows: u32,
    pub codebook_rows: u32,
    pub luma: u32,
    pub chroma: u32,
    pub color_step: f32,
    pub table_scale: f32,
}

/// Returns the layout of fields' bind groups: their uniform, table records, child records, densities, coefficients, and
/// the codebook of a packed field. Other fields bind their coefficients in its place.
pub(crate) fn field_layout() -> BindGroupLayoutDescriptor {
    let words = || texture_2d_array(TextureSampleType::Uint);
    let entries = BindGroupLayoutEntries::sequential(
        ShaderStages::FRAGMENT | ShaderStages::COMPUTE,
        (uniform_buffer::<FieldUniform>(false), words(), words(), words(), words(), words()),
    );
    BindGroupLayoutDescriptor::new("plenoctree_field", &entries)
}

impl TreeShape {
    /// Returns the shader definitions for `octree.wgsl`.
    pub fn definitions(self) -> impl Iterator<Item = ShaderDefVal> {
        let inner_levels = ShaderDefVal::UInt("INNER_LEVELS".into(), self.inner_levels);
        let has_codebook = self.has_codebook.then(|| "CODEBOOK".into());
        (self.inner_levels > 0).then_some(inner_levels).into_iter().chain(has_codebook)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::layouts::assert_layout;

    #[test]
    fn shaders_find_every_field() {
        assert_layout!(FieldUniform, "octree", "Field");
    }
}
