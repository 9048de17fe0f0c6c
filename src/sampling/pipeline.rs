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

use crate::gpu::{FieldLayout, FieldShape, Shaders, field_definitions};

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

/// That of SH25.
const MOST_DEGREE: u32 = 4;

#[derive(Resource)]
pub(super) struct SamplingPipeline {
    shader: Handle<Shader>,
    pub layout: BindGroupLayoutDescriptor,
    field: FieldLayout,
}

pub(super) fn init(mut commands: Commands, shaders: Res<Shaders>, field: Res<FieldLayout>) {
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
        field: field.clone(),
    });
}

impl SpecializedComputePipeline for SamplingPipeline {
    type Key = FieldShape;

    fn specialize(&self, shape: FieldShape) -> ComputePipelineDescriptor {
        ComputePipelineDescriptor {
            label: Some("plenoctree_sampling".into()),
            layout: vec![self.layout.clone(), self.field.0.clone()],
            shader: self.shader.clone(),
            shader_defs: field_definitions(shape, MOST_DEGREE),
            entry_point: Some("sample".into()),
            ..default()
        }
    }
}
