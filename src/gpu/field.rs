//! A field's buffers.

use bevy::{
    asset::RenderAssetUsages,
    ecs::system::{SystemParamItem, lifetimeless::SRes},
    prelude::*,
    render::{
        render_asset::{AssetExtractionError, PrepareAssetError, RenderAsset},
        render_resource::{
            BindGroup, BindGroupEntries, BindGroupLayoutDescriptor, BindGroupLayoutEntries, Buffer,
            BufferInitDescriptor, BufferUsages, PipelineCache, ShaderStages, ShaderType,
            binding_types::{storage_buffer_read_only_sized, uniform_buffer},
        },
        renderer::RenderDevice,
    },
};
use half::f16;

use crate::field::{Activation, Basis, PlenOctree};

/// A field that the GPU cannot bind.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the field's {what} need {bytes} bytes on the GPU, which binds at most {limit} at once; \
     a smaller field, or spherical harmonics of a lower degree, would fit"
)]
pub struct FieldTooLarge {
    /// Which of the field's arrays does not fit.
    pub what: &'static str,
    /// Its size.
    pub bytes: u64,
    /// The device's `max_storage_buffer_binding_size` or `max_buffer_size`, the lower of both.
    pub limit: u64,
}

/// A [`PlenOctree`] in GPU memory, in the render world's `RenderAssets<GpuField>`.
pub struct GpuField {
    pub(crate) bind_group: Option<BindGroup>,
    pub(crate) basis: Basis,
    pub(crate) activation: Activation,
    bytes: u64,
}

/// What a shader must know of a field beside its arrays.
#[derive(Clone, Copy, ShaderType)]
struct FieldUniform {
    /// Levels of cells.
    depth: u32,
}

/// Layout of the bind group of a field: its uniform, nodes, densities and coefficients.
#[derive(Resource)]
pub struct FieldLayout(pub(crate) BindGroupLayoutDescriptor);

impl Default for FieldLayout {
    fn default() -> Self {
        Self(BindGroupLayoutDescriptor::new(
            "plenoctree_field",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::FRAGMENT | ShaderStages::COMPUTE,
                (
                    uniform_buffer::<FieldUniform>(false),
                    storage_buffer_read_only_sized(false, None),
                    storage_buffer_read_only_sized(false, None),
                    storage_buffer_read_only_sized(false, None),
                ),
            ),
        ))
    }
}

impl GpuField {
    /// Bytes that `field` takes in GPU memory.
    pub fn byte_size(field: &PlenOctree) -> u64 {
        Self::arrays(field).iter().map(|(_, bytes)| bytes).sum()
    }

    /// Whether a device with these `limits` can bind the field.
    pub fn check(field: &PlenOctree, limits: &wgpu::Limits) -> Result<(), FieldTooLarge> {
        let limit = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        match Self::arrays(field).into_iter().find(|(_, bytes)| *bytes > limit) {
            Some((what, bytes)) => Err(FieldTooLarge { what, bytes, limit }),
            None => Ok(()),
        }
    }

    /// Bytes in GPU memory.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    fn arrays(field: &PlenOctree) -> [(&'static str, u64); 3] {
        let leaves = field.leaves().max(1) as u64;
        let words = 3 * words_per_channel(field.basis()) as u64;
        [("nodes", field.nodes().len() as u64 * 32), ("densities", leaves * 4), ("coefficients", leaves * words * 4)]
    }
}

/// 32-bit words, of two half floats each, that one channel of one leaf takes.
pub(crate) fn words_per_channel(basis: Basis) -> usize {
    basis.functions().div_ceil(2)
}

/// The coefficients with every channel padded to whole words, so that a shader reads pairs.
fn pack_coefficients(field: &PlenOctree) -> Vec<u32> {
    let functions = field.basis().functions();
    let words = words_per_channel(field.basis());
    let mut packed = Vec::with_capacity(field.leaves() * 3 * words);
    for channel in field.coefficients().chunks_exact(functions) {
        for pair in channel.chunks(2) {
            let high = pair.get(1).copied().unwrap_or(f16::ZERO);
            packed.push(u32::from(pair[0].to_bits()) | u32::from(high.to_bits()) << 16);
        }
    }
    packed
}

impl RenderAsset for GpuField {
    type SourceAsset = PlenOctree;
    type Param = (SRes<RenderDevice>, SRes<PipelineCache>, SRes<FieldLayout>);

    fn asset_usage(_: &PlenOctree) -> RenderAssetUsages {
        // The main world keeps the field, for extraction; the arrays are shared, so the copy costs nothing.
        RenderAssetUsages::MAIN_WORLD | RenderAssetUsages::RENDER_WORLD
    }

    fn take_gpu_data(source: &mut PlenOctree, _: Option<&Self>) -> Result<PlenOctree, AssetExtractionError> {
        Ok(source.clone())
    }

    fn byte_len(source: &PlenOctree) -> Option<usize> {
        usize::try_from(Self::byte_size(source)).ok()
    }

    fn prepare_asset(
        field: PlenOctree,
        id: AssetId<PlenOctree>,
        (device, pipelines, layout): &mut SystemParamItem<Self::Param>,
        _: Option<&Self>,
    ) -> Result<Self, PrepareAssetError<PlenOctree>> {
        let bind_group = match Self::check(&field, &device.limits()) {
            Ok(()) => Some(bind(&field, device, &pipelines.get_bind_group_layout(&layout.0))),
            Err(error) => {
                error!("{id} is not drawn: {error}");
                None
            }
        };
        Ok(Self {
            bytes: if bind_group.is_some() { Self::byte_size(&field) } else { 0 },
            bind_group,
            basis: field.basis(),
            activation: field.activation(),
        })
    }
}

fn bind(
    field: &PlenOctree,
    device: &RenderDevice,
    layout: &bevy::render::render_resource::BindGroupLayout,
) -> BindGroup {
    let storage = |label, contents: &[u8]| -> Buffer {
        // A binding of no bytes is not allowed, and an empty field still has a root to look at.
        let contents = if contents.is_empty() { &[0; 4] } else { contents };
        device.create_buffer_with_data(&BufferInitDescriptor {
            label: Some(label),
            contents,
            usage: BufferUsages::STORAGE,
        })
    };
    let uniform = device.create_buffer_with_data(&BufferInitDescriptor {
        label: Some("plenoctree_field"),
        contents: bytemuck::cast_slice(&[field.depth(), 0, 0, 0]),
        usage: BufferUsages::UNIFORM,
    });
    let nodes = storage("plenoctree_nodes", bytemuck::cast_slice(field.nodes()));
    let densities = storage("plenoctree_densities", bytemuck::cast_slice(field.densities()));
    let coefficients = storage("plenoctree_coefficients", bytemuck::cast_slice(&pack_coefficients(field)));
    device.create_bind_group(
        "plenoctree_field",
        layout,
        &BindGroupEntries::sequential((
            uniform.as_entire_buffer_binding(),
            nodes.as_entire_buffer_binding(),
            densities.as_entire_buffer_binding(),
            coefficients.as_entire_buffer_binding(),
        )),
    )
}
