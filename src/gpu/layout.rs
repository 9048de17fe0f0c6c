//! The layouts of fields' bind groups.

use bevy::{
    prelude::*,
    render::render_resource::{
        BindGroupLayoutDescriptor, BindGroupLayoutEntries, ShaderStages, TextureFormat, binding_types::uniform_buffer,
    },
    shader::ShaderDefVal,
};

use super::{
    upload::{FieldShape, FieldUniform},
    words::WordTextures,
};

/// The format of densities: one in each word, or two half floats if the field is packed.
pub(super) const DENSITIES: TextureFormat = TextureFormat::R32Uint;
/// The format of records, and of coefficients that are not packed.
pub(super) const WORDS: TextureFormat = TextureFormat::Rgba32Uint;
/// The format of the leaves of packed fields, and of their codebook.
pub(super) const PACKED_WORDS: TextureFormat = TextureFormat::Rg32Uint;

/// The properties of a field that all pipelines that march through it are specialized for. Others also depend on how
/// radiance is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct TreeShape {
    /// Whether there are child records besides the table.
    inner_records: bool,
    /// Whether densities and coefficients have the formats of packed fields.
    has_codebook: bool,
}

impl From<FieldShape> for TreeShape {
    fn from(shape: FieldShape) -> Self {
        Self { inner_records: shape.inner_records, has_codebook: shape.payload.has_codebook() }
    }
}

/// The layouts of fields' bind groups: their uniform, table records, child records, densities, coefficients, and the
/// codebook of a packed field. Other fields bind their coefficients in its place.
#[derive(Resource, Clone)]
pub(crate) struct FieldLayouts {
    plain: BindGroupLayoutDescriptor,
    with_codebook: BindGroupLayoutDescriptor,
    textures: WordTextures,
}

pub(super) fn init(mut commands: Commands, textures: Res<WordTextures>) {
    let layout = |coefficients| {
        let entries = BindGroupLayoutEntries::sequential(
            ShaderStages::FRAGMENT | ShaderStages::COMPUTE,
            (
                uniform_buffer::<FieldUniform>(false),
                textures.entry_with_layers(WORDS),
                textures.entry_with_layers(WORDS),
                textures.entry_with_layers(DENSITIES),
                textures.entry_with_layers(coefficients),
                textures.entry_with_layers(coefficients),
            ),
        );
        BindGroupLayoutDescriptor::new("plenoctree_field", &entries)
    };
    commands.insert_resource(FieldLayouts {
        plain: layout(WORDS),
        with_codebook: layout(PACKED_WORDS),
        textures: *textures,
    });
}

impl FieldLayouts {
    pub fn of(&self, tree: TreeShape) -> &BindGroupLayoutDescriptor {
        if tree.has_codebook { &self.with_codebook } else { &self.plain }
    }

    /// Returns the shader definitions for `octree.wgsl`.
    pub fn definitions(&self, tree: TreeShape) -> Vec<ShaderDefVal> {
        let mut definitions = self.textures.definitions();
        if tree.inner_records {
            definitions.push("INNER_RECORDS".into());
        }
        if tree.has_codebook {
            definitions.push("HALF_DENSITIES".into());
        }
        definitions
    }
}
