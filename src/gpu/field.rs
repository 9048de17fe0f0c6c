//! A field's textures.

use std::sync::Arc;

use bevy::{
    asset::RenderAssetUsages,
    ecs::system::{SystemParamItem, lifetimeless::SRes},
    prelude::*,
    render::{
        render_asset::{AssetExtractionError, PrepareAssetError, RenderAsset, RenderAssets},
        render_resource::{
            BindGroup, BindGroupEntries, BindGroupLayoutDescriptor, BindGroupLayoutEntries, BufferInitDescriptor,
            BufferUsages, PipelineCache, ShaderStages, TextureSampleType,
            binding_types::{texture_2d, texture_3d, uniform_buffer},
        },
        renderer::{RenderDevice, RenderQueue},
    },
    tasks::block_on,
};
use glam::DVec3;

use super::{
    levels::{Level, Levels},
    payload::Payload,
    records::Records,
    upload::{Row, upload_table},
};
use crate::field::{Activation, PlenOctree};

/// A field that the GPU cannot hold.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the field's {what} need {bytes} bytes on the GPU, {}; a field with fewer leaves or spherical harmonics of a lower \
     degree would fit, and compact ones (`Precision::Byte`) take half as much",
    .limit.map_or("which has less memory left".into(), |limit| format!("which can hold {limit} of them"))
)]
pub struct FieldTooLarge {
    /// Which of the field's parts does not fit.
    pub what: &'static str,
    /// Its size.
    pub bytes: u64,
    /// How much of them the device can hold: a texture of four words a texel, `max_texture_dimension_2d` high and as wide,
    /// but at most 8192 wide. `None` if the driver found no room, and did not say how much there is.
    pub limit: Option<u64>,
}

/// A [`PlenOctree`] in GPU memory, in the render world's `RenderAssets<GpuField>`.
pub struct GpuField(Levels);

/// One form of a field, as shaders see it.
pub(crate) struct GpuLevel {
    pub bind_group: BindGroup,
    pub shape: FieldShape,
    /// The box around the leaves, in tree units.
    pub bounds: Option<(DVec3, DVec3)>,
    bytes: u64,
}

/// What pipelines that read a field are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct FieldShape {
    pub payload: Payload,
    pub activation: Activation,
    /// Whether there are records besides the table.
    pub inner_records: bool,
}

/// `Field` of `octree.wgsl`.
#[derive(Clone, Copy, bevy::render::render_resource::ShaderType)]
struct FieldUniform {
    depth: u32,
    table_level: u32,
    row: u32,
}

/// The layout of the bind group of a field: its uniform, the records of its octree, densities and coefficients.
#[derive(Resource, Clone)]
pub struct FieldLayout(pub(crate) BindGroupLayoutDescriptor);

impl Default for FieldLayout {
    fn default() -> Self {
        let words = || texture_2d(TextureSampleType::Uint);
        Self(BindGroupLayoutDescriptor::new(
            "plenoctree_field",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::FRAGMENT | ShaderStages::COMPUTE,
                (
                    uniform_buffer::<FieldUniform>(false),
                    texture_3d(TextureSampleType::Uint),
                    words(),
                    texture_2d(TextureSampleType::Float { filterable: false }),
                    words(),
                ),
            ),
        ))
    }
}

impl GpuField {
    /// Bytes that `field` takes in GPU memory, at most: without the forms that cameras'
    /// [`Quality`](crate::Quality) may ask for.
    pub fn byte_size(field: &PlenOctree) -> u64 {
        Records::most_bytes(field, table_allowance(field))
            + Self::arrays(field).iter().map(|(_, bytes)| bytes).sum::<u64>()
    }

    /// Whether a device with these `limits` can hold the field.
    pub fn check(field: &PlenOctree, limits: &wgpu::Limits) -> Result<(), FieldTooLarge> {
        let row = Row::new(limits);
        let limit = row.most_texels() * 16;
        let too_large = Self::arrays(field).into_iter().find(|(_, bytes)| *bytes > limit);
        too_large.map_or(Ok(()), |(what, bytes)| Err(FieldTooLarge { what, bytes, limit: Some(limit) }))
    }

    /// Bytes in GPU memory, those of the forms that cameras ask for included.
    pub fn bytes(&self) -> u64 {
        self.0.iter().map(|level| level.bytes).sum()
    }

    /// A form of the field that was made; `None` if the GPU cannot hold it.
    pub(crate) fn level(&self, level: Level) -> Option<&Arc<GpuLevel>> {
        self.0.get(level)
    }

    /// The form of the field to draw where one is wanted: that, or what stands in for it while it is made.
    pub(crate) fn ask(&mut self, wanted: Level, uploader: &Uploader) -> Level {
        self.0.ask(wanted, uploader)
    }

    /// Whether a form that a camera asked for in the last frame is still being made.
    pub(crate) fn is_busy(&self) -> bool {
        self.0.is_busy()
    }

    fn arrays(field: &PlenOctree) -> [(&'static str, u64); 2] {
        let leaves = field.leaves().max(1) as u64;
        [("densities", leaves * 4), ("coefficients", leaves * 16 * Payload::of(field).texels() as u64)]
    }
}

/// An eighth of what the coefficients take.
fn table_allowance(field: &PlenOctree) -> u64 {
    let [_, (_, coefficients)] = GpuField::arrays(field);
    coefficients / 8
}

/// A field that is ready to be uploaded.
pub(super) struct Form {
    pub field: PlenOctree,
    records: Records,
}

impl Form {
    /// Works as long as it takes to look at all leaves.
    pub fn new(field: PlenOctree) -> Self {
        let records = Records::new(&field, table_allowance(&field));
        Self { field, records }
    }
}

/// What it takes to put fields into GPU memory.
pub(crate) struct Uploader<'a> {
    pub device: &'a RenderDevice,
    pub queue: &'a RenderQueue,
    pub pipelines: &'a PipelineCache,
    pub layout: &'a FieldLayout,
}

impl Uploader<'_> {
    /// `None`, with an error in the log, if the GPU cannot hold the field.
    pub(super) fn upload(&self, form: &Form) -> Option<Arc<GpuLevel>> {
        // What the driver refuses, be it for want of memory, is found out here and not in the middle of a frame.
        let memory = self.device.wgpu_device().push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let level = GpuField::check(&form.field, &self.device.limits()).map(|()| self.level(form));
        let level = match (block_on(memory.pop()), level) {
            (Some(_), Ok(level)) => Err(FieldTooLarge { what: "textures", bytes: level.bytes, limit: None }),
            (_, level) => level,
        };
        level.inspect_err(|error| error!("a field is not drawn: {error}")).ok().map(Arc::new)
    }

    fn level(&self, Form { field, records }: &Form) -> GpuLevel {
        let payload = Payload::of(field);
        let row = Row::new(&self.device.limits());
        let uniform = [records.depth, records.table_level, row.log2(), 0];
        let uniform = self.device.create_buffer_with_data(&BufferInitDescriptor {
            label: Some("plenoctree_field"),
            contents: bytemuck::cast_slice(&uniform),
            usage: BufferUsages::UNIFORM,
        });
        let (device, queue) = (self.device, self.queue);
        let table = upload_table(device, queue, &records.table, records.table_level);
        let below = row.upload_words(device, queue, "plenoctree_records", &records.below);
        let densities = row.upload_densities(device, queue, field.densities());
        let coefficients = row.upload_coefficients(device, queue, payload, field.coefficients());
        let views = [&table, &below, &densities, &coefficients].map(|texture| texture.create_view(&default()));
        let bytes = [&table, &below, &densities, &coefficients].map(|texture| {
            let size = texture.size();
            let texel = texture.format().block_copy_size(None).unwrap_or(0);
            u64::from(size.width) * u64::from(size.height) * u64::from(size.depth_or_array_layers) * u64::from(texel)
        });
        let bind_group = self.device.create_bind_group(
            "plenoctree_field",
            &self.pipelines.get_bind_group_layout(&self.layout.0),
            &BindGroupEntries::sequential((uniform.as_entire_binding(), &views[0], &views[1], &views[2], &views[3])),
        );
        GpuLevel {
            bind_group,
            shape: FieldShape { payload, activation: field.activation(), inner_records: !records.below.is_empty() },
            bounds: field.tree_bounds(),
            bytes: bytes.iter().sum(),
        }
    }
}

impl RenderAsset for GpuField {
    type SourceAsset = PlenOctree;
    type Param = (SRes<RenderDevice>, SRes<RenderQueue>, SRes<PipelineCache>, SRes<FieldLayout>);

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
        _: AssetId<PlenOctree>,
        (device, queue, pipelines, layout): &mut SystemParamItem<Self::Param>,
        _: Option<&Self>,
    ) -> Result<Self, PrepareAssetError<PlenOctree>> {
        Ok(Self(Levels::new(field, &Uploader { device, queue, pipelines, layout })))
    }
}

/// Drops forms of fields that no camera has drawn for long.
pub(super) fn drop_idle_levels(mut fields: ResMut<RenderAssets<GpuField>>) {
    for (_, field) in fields.iter_mut() {
        field.0.age();
    }
}
