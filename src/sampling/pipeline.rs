//! The compute pipeline.

use bevy::{
    prelude::*,
    render::render_resource::{
        BindGroupLayoutDescriptor, BindGroupLayoutEntries, ComputePipelineDescriptor, ShaderStages, ShaderType,
        SpecializedComputePipeline,
        binding_types::{storage_buffer_read_only_sized, storage_buffer_sized, uniform_buffer},
    },
    shader::Shader,
};

use crate::{
    field::{Activation, Basis},
    gpu::{FieldLayouts, Shaders, radiance_definitions},
};

/// `Slice` of `sampling.wgsl`.
#[derive(ShaderType, Clone, Copy)]
pub(super) struct SliceUniform {
    pub frame_scale: Vec3,
    pub first: u32,
    pub leaves: u32,
    pub rays_per_cell: u32,
    pub fine_bins: u32,
    pub coarse_bins: u32,
    pub limit: f32,
    pub weight_scale: f32,
}

#[derive(Resource)]
pub(super) struct SamplingPipeline {
    shader: Handle<Shader>,
    pub layout: BindGroupLayoutDescriptor,
    fields: FieldLayouts,
}

pub(super) fn init(mut commands: Commands, shaders: Res<Shaders>, fields: Res<FieldLayouts>) {
    commands.insert_resource(SamplingPipeline {
        shader: shaders.sampling.clone(),
        layout: BindGroupLayoutDescriptor::new(
            "plenoctree_sampling",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::COMPUTE,
                (
                    uniform_buffer::<SliceUniform>(false),
                    storage_buffer_read_only_sized(false, None),
                    storage_buffer_read_only_sized(false, None),
                    storage_buffer_sized(false, None),
                ),
            ),
        ),
        fields: fields.clone(),
    });
}

impl SpecializedComputePipeline for SamplingPipeline {
    /// Basis and activation of the field, and the parts of its coefficients.
    type Key = (Basis, Activation, usize);

    fn specialize(&self, (basis, activation, parts): Self::Key) -> ComputePipelineDescriptor {
        ComputePipelineDescriptor {
            label: Some("plenoctree_sampling".into()),
            layout: vec![self.layout.clone(), self.fields.get(parts).clone()],
            shader: self.shader.clone(),
            shader_defs: radiance_definitions(basis, activation, parts),
            entry_point: Some("sample".into()),
            ..default()
        }
    }
}
