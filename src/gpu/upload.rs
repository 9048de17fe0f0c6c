//! From a field to its textures and bind group.

use std::sync::Arc;

use bevy::{
    ecs::system::SystemParam,
    prelude::*,
    render::{
        render_resource::{
            BindGroup, BindGroupEntries, BindGroupLayoutDescriptor, BindGroupLayoutEntries, BufferInitDescriptor,
            BufferUsages, PipelineCache, ShaderStages, ShaderType, TextureSampleType,
            binding_types::{texture_2d, texture_3d, uniform_buffer},
        },
        renderer::{RenderDevice, RenderQueue},
    },
    tasks::{AsyncComputeTaskPool, Task, block_on, poll_once},
};
use glam::DVec3;
use plenoctree::{Activation, PlenOctree};

use super::{
    payload::Payload,
    records::Records,
    textures::{Row, upload_table},
};

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

/// A level of a field in GPU memory, as shaders read it.
pub(crate) struct GpuLevel {
    pub bind_group: BindGroup,
    pub shape: FieldShape,
    /// The box around the leaves, in tree units.
    pub bounds: Option<(DVec3, DVec3)>,
    pub bytes: u64,
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
#[derive(Clone, Copy, ShaderType)]
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

/// Bytes of a field's densities and of its coefficients on the GPU.
pub(super) fn arrays(field: &PlenOctree) -> [(&'static str, u64); 2] {
    let leaves = field.leaves().max(1) as u64;
    [("densities", leaves * 4), ("coefficients", leaves * 16 * Payload::of(field).texels() as u64)]
}

/// The bytes that a field's table may take: an eighth of what its coefficients take.
pub(super) fn table_allowance(field: &PlenOctree) -> u64 {
    let [_, (_, coefficients)] = arrays(field);
    coefficients / 8
}

/// Whether a device with these `limits` can hold the field.
pub(super) fn check(field: &PlenOctree, limits: &wgpu::Limits) -> Result<(), FieldTooLarge> {
    let limit = Row::new(limits).most_texels() * 16;
    let too_large = arrays(field).into_iter().find(|(_, bytes)| *bytes > limit);
    too_large.map_or(Ok(()), |(what, bytes)| Err(FieldTooLarge { what, bytes, limit: Some(limit) }))
}

/// A level that is ready to be uploaded.
pub(super) struct LevelData {
    pub field: PlenOctree,
    records: Records,
}

impl LevelData {
    /// Visits every leaf, which takes a moment for a large field.
    pub fn new(field: PlenOctree) -> Self {
        let records = Records::new(&field, table_allowance(&field));
        Self { field, records }
    }
}

/// An upload whose outcome the driver has still to tell.
pub(super) struct Upload {
    level: Arc<GpuLevel>,
    error: Task<Option<wgpu::Error>>,
}

impl Upload {
    /// The outcome, as soon as there is one.
    pub fn poll(&mut self) -> Option<Result<Arc<GpuLevel>, FieldTooLarge>> {
        let error = block_on(poll_once(&mut self.error))?;
        Some(outcome(&self.level, error))
    }
}

/// What comes of an upload at once.
pub(super) enum Uploaded {
    Now(Result<Arc<GpuLevel>, FieldTooLarge>),
    Later(Upload),
}

fn outcome(level: &Arc<GpuLevel>, error: Option<wgpu::Error>) -> Result<Arc<GpuLevel>, FieldTooLarge> {
    match error {
        Some(_) => Err(FieldTooLarge { what: "textures", bytes: level.bytes, limit: None }),
        None => Ok(level.clone()),
    }
}

/// What it takes to put fields into GPU memory.
#[derive(SystemParam)]
pub struct Uploader<'w> {
    device: Res<'w, RenderDevice>,
    queue: Res<'w, RenderQueue>,
    pipelines: Res<'w, PipelineCache>,
    layout: Res<'w, FieldLayout>,
}

impl Uploader<'_> {
    pub(super) fn upload(&self, data: &LevelData) -> Uploaded {
        if let Err(error) = check(&data.field, &self.device.limits()) {
            return Uploaded::Now(Err(error));
        }
        // What the driver refuses, be it for want of memory, is found out here and not in the middle of a frame. Textures
        // without memory make what uses them invalid too.
        let device = self.device.wgpu_device();
        let invalid = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let memory = device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let level = Arc::new(self.level(data));
        let (memory, invalid) = (memory.pop(), invalid.pop());
        let mut error = Box::pin(async move {
            let memory = memory.await;
            memory.or(invalid.await)
        });
        // Native drivers know at once; browsers tell later.
        match block_on(poll_once(&mut error)) {
            Some(error) => Uploaded::Now(outcome(&level, error)),
            None => Uploaded::Later(Upload { level, error: AsyncComputeTaskPool::get().spawn(error) }),
        }
    }

    fn level(&self, LevelData { field, records }: &LevelData) -> GpuLevel {
        let payload = Payload::of(field);
        let row = Row::new(&self.device.limits());
        let uniform = [records.depth, records.table_level, row.log2(), 0];
        let uniform = self.device.create_buffer_with_data(&BufferInitDescriptor {
            label: Some("plenoctree_field"),
            contents: bytemuck::cast_slice(&uniform),
            usage: BufferUsages::UNIFORM,
        });
        let (device, queue) = (&self.device, &self.queue);
        let table = upload_table(device, queue, &records.table, records.table_level);
        let children = row.upload_words(device, queue, "plenoctree_records", &records.children);
        let densities = row.upload_densities(device, queue, field.densities());
        let coefficients = row.upload_coefficients(device, queue, payload, field.coefficients());
        let views = [&table, &children, &densities, &coefficients].map(|texture| texture.create_view(&default()));
        let bytes = [&table, &children, &densities, &coefficients].map(|texture| {
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
            shape: FieldShape { payload, activation: field.activation(), inner_records: !records.children.is_empty() },
            bounds: field.tree_bounds(),
            bytes: bytes.iter().sum(),
        }
    }
}
