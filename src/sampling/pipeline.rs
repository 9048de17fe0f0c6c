//! The compute pipeline for sampling.

use bevy::{
    prelude::*,
    render::render_resource::{
        BindGroupLayoutDescriptor, BindGroupLayoutEntries, ComputePipelineDescriptor, ShaderStages, ShaderType,
        SpecializedComputePipeline,
        binding_types::{storage_buffer_read_only_sized, storage_buffer_sized, uniform_buffer},
    },
    shader::Shader,
};

use crate::gpu::{FieldLayouts, FieldShape, Shaders, TreeShape, field_definitions};

/// Matches `Slice` in `sampling.wgsl`.
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
    fields: FieldLayouts,
}

pub(super) fn init(mut commands: Commands, shaders: Res<Shaders>, fields: Res<FieldLayouts>) {
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
        fields: fields.clone(),
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
            layout: vec![layout.clone(), self.fields.get().clone()],
            shader: shader.clone(),
            shader_defs: field_definitions(shape).into_iter().chain(tree).chain(lattice).collect(),
            entry_point: Some(entry_point.into()),
            ..default()
        }
    }
}

#[cfg(all(test, feature = "headless"))]
mod tests {
    use bevy::render::render_resource::UniformBuffer;

    use super::*;
    use crate::tests::layouts::{counting, read_back};

    /// The rest of the shader, after the declaration of the struct.
    const SHADER: &str = "
@group(0) @binding(0) var<uniform> slice: Slice;
@group(1) @binding(0) var<storage, read_write> found: array<f32>;

@compute @workgroup_size(1)
fn read() {
    found[0] = slice.frame_scale.x;
    found[1] = slice.frame_scale.y;
    found[2] = slice.frame_scale.z;
    found[3] = f32(slice.leaves);
    found[4] = f32(slice.rays_per_cell);
    found[5] = f32(slice.fine_bins);
    found[6] = f32(slice.coarse_bins);
    found[7] = slice.limit;
    found[8] = slice.weight_scale;
    found[9] = f32(slice.at_entry);
    for (var axis = 0u; axis < 3u; axis++) {
        found[10u + axis] = f32(slice.lattice_low[axis]);
        found[13u + axis] = f32(slice.lattice_size[axis]);
    }
}
";

    #[test]
    fn shaders_find_every_field_of_slices() {
        let sampling = include_str!("../../shaders/sampling.wgsl");
        let (begin, end) = (sampling.find("struct Slice").unwrap(), sampling.find("@group(0)").unwrap());
        let mut next = counting();
        let slice = SliceUniform {
            frame_scale: Vec3::new(next(), next(), next()),
            leaves: next() as u32,
            rays_per_cell: next() as u32,
            fine_bins: next() as u32,
            coarse_bins: next() as u32,
            limit: next(),
            weight_scale: next(),
            at_entry: next() as u32,
            lattice_low: IVec3::from_array(std::array::from_fn(|_| next() as i32)),
            lattice_size: IVec3::from_array(std::array::from_fn(|_| next() as i32)),
        };
        let entries = BindGroupLayoutEntries::single(ShaderStages::COMPUTE, uniform_buffer::<SliceUniform>(false));
        let layout = BindGroupLayoutDescriptor::new("layout_test", &entries);
        let found: [f32; 16] = read_back(sampling[begin..end].to_string() + SHADER, layout, |device, queue, run| {
            let mut slice = UniformBuffer::from(slice);
            slice.write_buffer(device, queue);
            run(&[slice.binding().unwrap()]);
        });
        assert_eq!(found, std::array::from_fn(|index| (index + 1) as f32));
    }
}
