//! The compute pipelines for sampling leaves and looking at views.

use bevy::{
    prelude::*,
    render::render_resource::{
        BindGroupLayoutDescriptor, BindGroupLayoutEntries, ComputePipelineDescriptor, ShaderStages, ShaderType,
        SpecializedComputePipeline,
        binding_types::{storage_buffer_read_only_sized, storage_buffer_sized, uniform_buffer},
    },
    shader::Shader,
};

use crate::gpu::{FieldShape, Shaders, TreeShape, field_definitions, field_layout};

/// Matches `Slice` in `sampling.wgsl`.
#[cfg_attr(test, derive(Reflect))]
#[derive(ShaderType, Clone, Copy)]
pub(super) struct SliceUniform {
    pub frame_scale: Vec3,
    pub leaves: u32,
    pub rays_per_cell: u32,
    pub fine_bins: u32,
    pub coarse_bins: u32,
    pub limit: f32,
    pub weight_scale: f32,
    pub at_entry: u32,
    pub lattice_low: IVec3,
    pub lattice_size: IVec3,
}

#[derive(Resource)]
pub(super) struct SamplingPipeline {
    leaves_shader: Handle<Shader>,
    views_shader: Handle<Shader>,
    pub leaves_layout: BindGroupLayoutDescriptor,
    pub views_layout: BindGroupLayoutDescriptor,
}

pub(super) fn init(mut commands: Commands, shaders: Res<Shaders>) {
    commands.insert_resource(SamplingPipeline {
        leaves_shader: shaders.get("sampling"),
        views_shader: shaders.get("see"),
        leaves_layout: BindGroupLayoutDescriptor::new(
            "plenoctree_sampling",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::COMPUTE,
                (
                    uniform_buffer::<SliceUniform>(false),
                    storage_buffer_read_only_sized(false, None),
                    storage_buffer_read_only_sized(false, None),
                    storage_buffer_sized(false, None),
                    storage_buffer_read_only_sized(false, None),
                ),
            ),
        ),
        views_layout: BindGroupLayoutDescriptor::new(
            "plenoctree_views",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::COMPUTE,
                (storage_buffer_read_only_sized(false, None), storage_buffer_sized(false, None)),
            ),
        ),
    });
}

/// What a pipeline samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Sampled {
    /// Leaves. If the finest cells of the field are listed, rays follow those.
    Leaves { lattice: bool },
    /// What rays see from outside.
    Views,
}

impl SpecializedComputePipeline for SamplingPipeline {
    type Key = (FieldShape, Sampled);

    fn specialize(&self, (shape, sampled): Self::Key) -> ComputePipelineDescriptor {
        let (label, layout, shader, entry_point) = match sampled {
            Sampled::Leaves { .. } => ("plenoctree_sampling", &self.leaves_layout, &self.leaves_shader, "sample"),
            Sampled::Views => ("plenoctree_views", &self.views_layout, &self.views_shader, "see"),
        };
        let lattice = (sampled == Sampled::Leaves { lattice: true }).then(|| "LATTICE".into());
        let tree = TreeShape::from(shape).definitions();
        ComputePipelineDescriptor {
            label: Some(label.into()),
            layout: vec![layout.clone(), field_layout()],
            shader: shader.clone(),
            shader_defs: field_definitions(shape).into_iter().chain(tree).chain(lattice).collect(),
            entry_point: Some(entry_point.into()),
            ..default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::layouts::assert_layout;

    #[test]
    fn shaders_find_every_field() {
        assert_layout!(SliceUniform, "sampling", "Slice");
    }
}
