//! A field's buffers.

use bevy::{
    asset::RenderAssetUsages,
    ecs::system::{SystemParamItem, lifetimeless::SRes},
    prelude::*,
    render::{
        render_asset::{AssetExtractionError, PrepareAssetError, RenderAsset},
        render_resource::{
            BindGroup, BindGroupEntry, BindGroupLayout, BindGroupLayoutDescriptor, BindGroupLayoutEntries, Buffer,
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
    "the field's {what} need {bytes} bytes on the GPU, which can bind {limit} of them; a field with fewer leaves, or \
     spherical harmonics of a lower degree, would fit"
)]
pub struct FieldTooLarge {
    /// Which of the field's arrays does not fit.
    pub what: &'static str,
    /// Its size.
    pub bytes: u64,
    /// How much of them the device can bind: its `max_storage_buffer_binding_size` or `max_buffer_size`, the lower of
    /// both, and four times that for coefficients.
    pub limit: u64,
}

/// A [`PlenOctree`] in GPU memory, in the render world's `RenderAssets<GpuField>`.
pub struct GpuField {
    pub(crate) bind_group: Option<BindGroup>,
    pub(crate) basis: Basis,
    pub(crate) activation: Activation,
    /// Bindings over which the coefficients are split.
    pub(crate) parts: usize,
    bytes: u64,
}

/// `Field` of `octree.wgsl`.
#[derive(Clone, Copy, ShaderType)]
struct FieldUniform {
    depth: u32,
    leaves_per_part: u32,
}

/// The most bindings over which the coefficients of a field are split: with them a shader uses the eight storage buffers
/// that every device has.
const MOST_PARTS: usize = 4;

/// Layouts of the bind group of a field: its uniform, nodes, densities, and coefficients in one part, in two, and so on.
#[derive(Resource, Clone)]
pub struct FieldLayouts([BindGroupLayoutDescriptor; MOST_PARTS]);

impl FieldLayouts {
    /// The layout for a field whose coefficients are in so many parts.
    pub(crate) fn get(&self, parts: usize) -> &BindGroupLayoutDescriptor {
        &self.0[parts.clamp(1, MOST_PARTS) - 1]
    }
}

impl Default for FieldLayouts {
    fn default() -> Self {
        Self(std::array::from_fn(|index| {
            let stages = ShaderStages::FRAGMENT | ShaderStages::COMPUTE;
            let array = || storage_buffer_read_only_sized(false, None);
            let uniform = uniform_buffer::<FieldUniform>(false);
            let mut entries = BindGroupLayoutEntries::sequential(stages, (uniform, array(), array())).to_vec();
            entries.extend((3..4 + index as u32).map(|binding| array().build(binding, stages)));
            BindGroupLayoutDescriptor::new("plenoctree_field", &entries)
        }))
    }
}

impl GpuField {
    /// Bytes that `field` takes in GPU memory.
    pub fn byte_size(field: &PlenOctree) -> u64 {
        Self::arrays(field).iter().map(|(_, bytes)| bytes).sum()
    }

    /// Whether a device with these `limits` can bind the field. Coefficients may take up to four bindings.
    pub fn check(field: &PlenOctree, limits: &wgpu::Limits) -> Result<(), FieldTooLarge> {
        let limit = binding_limit(limits);
        let [nodes, densities, (what, bytes)] = Self::arrays(field);
        if let Some((what, bytes)) = [nodes, densities].into_iter().find(|(_, bytes)| *bytes > limit) {
            return Err(FieldTooLarge { what, bytes, limit });
        }
        let room = leaves_per_part(field.basis(), limits) * MOST_PARTS as u64;
        if field.leaves() as u64 > room {
            return Err(FieldTooLarge { what, bytes, limit: limit * MOST_PARTS as u64 });
        }
        Ok(())
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

/// The most bytes that a storage binding holds.
fn binding_limit(limits: &wgpu::Limits) -> u64 {
    limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
}

/// Leaves whose coefficients a binding holds.
fn leaves_per_part(basis: Basis, limits: &wgpu::Limits) -> u64 {
    binding_limit(limits) / (12 * words_per_channel(basis) as u64)
}

/// Coefficients with every channel padded to whole words, so that a shader reads pairs.
fn pack_coefficients(basis: Basis, coefficients: &[f16]) -> Vec<u32> {
    let functions = basis.functions();
    let mut packed = Vec::with_capacity(coefficients.len() / functions * words_per_channel(basis));
    for channel in coefficients.chunks_exact(functions) {
        for pair in channel.chunks(2) {
            let high = pair.get(1).copied().unwrap_or(f16::ZERO);
            packed.push(u32::from(pair[0].to_bits()) | u32::from(high.to_bits()) << 16);
        }
    }
    packed
}

impl RenderAsset for GpuField {
    type SourceAsset = PlenOctree;
    type Param = (SRes<RenderDevice>, SRes<PipelineCache>, SRes<FieldLayouts>);

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
        (device, pipelines, layouts): &mut SystemParamItem<Self::Param>,
        _: Option<&Self>,
    ) -> Result<Self, PrepareAssetError<PlenOctree>> {
        let limits = device.limits();
        let per_part = leaves_per_part(field.basis(), &limits) as usize;
        let parts = field.leaves().div_ceil(per_part.max(1)).max(1);
        let bind_group = match Self::check(&field, &limits) {
            Ok(()) => Some(bind(&field, per_part, device, &pipelines.get_bind_group_layout(layouts.get(parts)))),
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
            parts,
        })
    }
}

fn bind(field: &PlenOctree, leaves_per_part: usize, device: &RenderDevice, layout: &BindGroupLayout) -> BindGroup {
    let buffer = |label, contents: &[u8], usage| -> Buffer {
        // A binding of no bytes is not allowed, and an empty field still has a root to look at.
        let contents = if contents.is_empty() { &[0; 4] } else { contents };
        device.create_buffer_with_data(&BufferInitDescriptor { label: Some(label), contents, usage })
    };
    let storage = |label, contents: &[u8]| buffer(label, contents, BufferUsages::STORAGE);
    let uniform = [field.depth(), leaves_per_part as u32, 0, 0];
    let mut buffers = vec![
        buffer("plenoctree_field", bytemuck::cast_slice(&uniform), BufferUsages::UNIFORM),
        storage("plenoctree_nodes", bytemuck::cast_slice(field.nodes())),
        storage("plenoctree_densities", bytemuck::cast_slice(field.densities())),
    ];
    // Part by part, so that no more than one is in memory twice.
    let all = field.coefficients();
    let parts = all.chunks((leaves_per_part * field.basis().coefficients()).max(1));
    for part in parts.chain(all.is_empty().then_some(all)) {
        let packed = pack_coefficients(field.basis(), part);
        buffers.push(storage("plenoctree_coefficients", bytemuck::cast_slice(&packed)));
    }
    let entries: Vec<BindGroupEntry> = (buffers.iter().zip(0..))
        .map(|(buffer, binding)| BindGroupEntry { binding, resource: buffer.as_entire_binding() })
        .collect();
    device.create_bind_group("plenoctree_field", layout, &entries)
}
