//! What the label pass and the blend pass read about lights.

use bevy::{
    prelude::*,
    render::render_resource::{
        BindGroupLayoutDescriptor, BindGroupLayoutEntries, RenderPipelineDescriptor, ShaderStages, TextureSampleType,
        binding_types::{storage_buffer_read_only_sized, texture_2d},
    },
};

use crate::render::bind_group::KeptBindGroup;

/// What the label pass and the blend pass read about lights. A component of views, which is empty if no prop is lit.
#[derive(Component, Default)]
pub(in crate::render) struct ReadLighting {
    pub is_lit: bool,
    /// Bind group 2 of these passes.
    pub group: KeptBindGroup,
}

/// The layout of [`ReadLighting`]'s bind group.
#[derive(Resource, Clone)]
pub(in crate::render) struct LightingLayout(pub BindGroupLayoutDescriptor);

impl Default for LightingLayout {
    fn default() -> Self {
        let texture = || texture_2d(TextureSampleType::Float { filterable: false });
        let entries = BindGroupLayoutEntries::sequential(
            ShaderStages::FRAGMENT,
            (storage_buffer_read_only_sized(false, None), texture(), texture()),
        );
        Self(BindGroupLayoutDescriptor::new("plenoctree_lit", &entries))
    }
}

impl LightingLayout {
    /// Lets the fragment shader of a pipeline read lights.
    pub fn add_to(&self, descriptor: &mut RenderPipelineDescriptor) {
        descriptor.layout.push(self.0.clone());
        if let Some(fragment) = &mut descriptor.fragment {
            fragment.shader_defs.push("LIGHTING".into());
        }
    }
}
