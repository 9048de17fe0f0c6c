//! Uploads a field: creates its textures and its bind group.

use std::sync::Arc;

use bevy::{
    ecs::system::SystemParam,
    prelude::*,
    render::{
        render_resource::{
            BindGroup, BindGroupEntries, BindGroupLayoutDescriptor, BindGroupLayoutEntries, PipelineCache,
            ShaderStages, ShaderType, TextureSampleType, UniformBuffer,
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

/// The error for a field that does not fit on the GPU.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the field's {what} need {bytes} bytes of GPU memory, {}; use fewer leaves, spherical harmonics of a lower degree, \
     or compact coefficients (`Precision::Byte`), which take half the memory",
    .limit.map_or("more than is left".into(), |limit| format!("more than the {limit} bytes that the device allows"))
)]
pub struct FieldTooLarge {
    /// The part of the field that does not fit.
    pub what: &'static str,
    /// The size of that part, in bytes.
    pub bytes: u64,
    /// The maximum size that the device allows, in bytes: that of a texture with four words per texel (one word for
    /// densities), whose height is `max_texture_dimension_2d`, and whose width is the same but at most 8192. `None` if
    /// the driver ran out of memory or refused a texture: drivers do not report how much is left. The log then holds
    /// the driver's message.
    pub limit: Option<u64>,
}

/// A level of a field in GPU memory.
pub(crate) struct GpuLevel {
    pub bind_group: BindGroup,
    pub shape: FieldShape,
    /// The box around the leaves, in tree units; `None` if there are no leaves.
    pub bounds: Option<(DVec3, DVec3)>,
    pub bytes: u64,
}

/// The properties of a field that pipelines are specialized for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct FieldShape {
    pub payload: Payload,
    pub activation: Activation,
    /// Whether there are child records besides the table.
    pub inner_records: bool,
}

/// Matches `Field` in `octree.wgsl`.
#[derive(Clone, Copy, ShaderType)]
struct FieldUniform {
    depth: u32,
    table_level: u32,
    row: u32,
}

/// The layout of a field's bind group: its uniform, table records, child records, densities, coefficients, and the
/// codebook of a packed field. Other fields bind their coefficients in its place.
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
                    words(),
                ),
            ),
        ))
    }
}

/// An array on the GPU: what it holds, its size in bytes, and the size of a texel.
pub(super) type Array = (&'static str, u64, u64);

/// Returns the sizes of a field's densities, of its leaves' coefficients, and of its codebook on the GPU.
pub(super) fn arrays(field: &PlenOctree) -> [Array; 3] {
    let leaves = field.leaves().max(1) as u64;
    let payload = Payload::of(field);
    let texels = payload.texels() as u64;
    match field.codebook() {
        None => [("densities", 4 * leaves, 4), ("coefficients", 16 * texels * leaves, 16), ("codebook", 0, 16)],
        Some(codebook) => {
            let width = payload.basis.coefficients() - 3;
            let rows = codebook.table.len().checked_div(width).unwrap_or(0) as u64;
            [
                ("densities", 2 * leaves, 2),
                ("coefficients", 8 * leaves, 8),
                ("codebook", 16 * (texels * rows).max(1), 16),
            ]
        }
    }
}

/// Returns the bytes that a field's table may take: an eighth of the size of its coefficients.
pub(super) fn table_allowance(field: &PlenOctree) -> u64 {
    let [_, (_, coefficients, _), _] = arrays(field);
    coefficients / 8
}

/// Checks whether a device with these `limits` can hold the field.
pub(super) fn check(field: &PlenOctree, limits: &wgpu::Limits) -> Result<(), FieldTooLarge> {
    let children = Records::child_count(field, table_allowance(field)) as u64;
    check_arrays(field, children, limits)
}

/// Checks a field whose number of child records is known.
fn check_arrays(field: &PlenOctree, children: u64, limits: &wgpu::Limits) -> Result<(), FieldTooLarge> {
    let texels = Row::new(limits).most_texels();
    let records = ("child records", 16 * children, 16);
    for (what, bytes, texel) in arrays(field).into_iter().chain([records]) {
        let limit = texel * texels;
        if bytes > limit {
            return Err(FieldTooLarge { what, bytes, limit: Some(limit) });
        }
    }
    Ok(())
}

/// A level that is ready to be uploaded.
pub(super) struct LevelData {
    pub field: PlenOctree,
    records: Records,
}

impl LevelData {
    /// Creates the records of `field`. Visits every leaf, which takes a moment for a large field.
    pub fn new(field: PlenOctree) -> Self {
        let records = Records::new(&field, table_allowance(&field));
        Self { field, records }
    }
}

/// An upload whose outcome the driver has not reported yet.
pub(super) struct Upload {
    level: Arc<GpuLevel>,
    error: Task<Option<wgpu::Error>>,
}

impl Upload {
    /// Returns the outcome, once the driver has reported it.
    pub fn poll(&mut self) -> Option<Result<Arc<GpuLevel>, FieldTooLarge>> {
        let error = block_on(poll_once(&mut self.error))?;
        Some(outcome(&self.level, error))
    }
}

/// The immediate result of an upload.
pub(super) enum Uploaded {
    Now(Result<Arc<GpuLevel>, FieldTooLarge>),
    Later(Upload),
}

fn outcome(level: &Arc<GpuLevel>, error: Option<wgpu::Error>) -> Result<Arc<GpuLevel>, FieldTooLarge> {
    match error {
        Some(error) => {
            warn!("the driver refused a field of {} bytes: {error}", level.bytes);
            Err(FieldTooLarge { what: "textures", bytes: level.bytes, limit: None })
        }
        None => Ok(level.clone()),
    }
}

/// A system parameter that uploads fields to GPU memory.
#[derive(SystemParam)]
pub struct Uploader<'w> {
    device: Res<'w, RenderDevice>,
    queue: Res<'w, RenderQueue>,
    pipelines: Res<'w, PipelineCache>,
    layout: Res<'w, FieldLayout>,
}

impl Uploader<'_> {
    pub(super) fn upload(&self, data: &LevelData) -> Uploaded {
        if let Err(error) = check_arrays(&data.field, data.records.children.len() as u64, &self.device.limits()) {
            return Uploaded::Now(Err(error));
        }
        // Catch driver errors, such as running out of memory, here instead of in the middle of a frame. Textures
        // without memory also invalidate whatever uses them.
        let device = self.device.wgpu_device();
        let invalid = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let memory = device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let level = Arc::new(self.level(data));
        let (memory, invalid) = (memory.pop(), invalid.pop());
        let mut error = Box::pin(async move {
            let memory = memory.await;
            memory.or(invalid.await)
        });
        // Native drivers report errors immediately, browsers later.
        match block_on(poll_once(&mut error)) {
            Some(error) => Uploaded::Now(outcome(&level, error)),
            None => Uploaded::Later(Upload { level, error: AsyncComputeTaskPool::get().spawn(error) }),
        }
    }

    fn level(&self, LevelData { field, records }: &LevelData) -> GpuLevel {
        let payload = Payload::of(field);
        let row = Row::new(&self.device.limits());
        let (device, queue) = (&self.device, &self.queue);
        let uniform = FieldUniform { depth: records.depth, table_level: records.table_level, row: row.log2() };
        let mut uniform = UniformBuffer::from(uniform);
        uniform.set_label(Some("plenoctree_field"));
        uniform.write_buffer(device, queue);
        let table = upload_table(device, queue, &records.table, records.table_level);
        let children = row.upload_words(device, queue, "plenoctree_records", &records.children);
        let densities = row.upload_densities(device, queue, field);
        let (coefficients, codebook) = row.upload_coefficients(device, queue, field);
        let own = [&table, &children, &densities, &coefficients].into_iter().chain(&codebook);
        let bytes = own.map(|texture| {
            let size = texture.size();
            let texel = texture.format().block_copy_size(None).unwrap_or(0);
            u64::from(size.width) * u64::from(size.height) * u64::from(size.depth_or_array_layers) * u64::from(texel)
        });
        let bytes = bytes.sum();
        let shared = codebook.as_ref().unwrap_or(&coefficients);
        let views =
            [&table, &children, &densities, &coefficients, shared].map(|texture| texture.create_view(&default()));
        let bind_group = self.device.create_bind_group(
            "plenoctree_field",
            &self.pipelines.get_bind_group_layout(&self.layout.0),
            &BindGroupEntries::sequential((&uniform, &views[0], &views[1], &views[2], &views[3], &views[4])),
        );
        GpuLevel {
            bind_group,
            shape: FieldShape { payload, activation: field.activation(), inner_records: !records.children.is_empty() },
            bounds: field.tree_bounds(),
            bytes,
        }
    }
}

#[cfg(all(test, feature = "headless"))]
mod tests {
    use super::*;
    use crate::tests::layouts::read_back;

    /// Also tests the constants that shaders import.
    const SHADER: &str = "
#import bevy_plenoctree::constants::{BRICK, HARMONICS, INNER, KIND, MAX_CHANNEL, MAX_DEPTH, NO_LEAF, SAMPLING_WORKGROUP, WHOLE}
STRUCT
@group(0) @binding(0) var<uniform> field: Field;
@group(1) @binding(0) var<storage, read_write> found: array<f32>;

@compute @workgroup_size(1)
fn read() {
    found[0] = f32(field.depth);
    found[1] = f32(field.table_level);
    found[2] = f32(field.row);
    found[3] = bitcast<f32>(BRICK);
    found[4] = bitcast<f32>(INNER);
    found[5] = bitcast<f32>(WHOLE & KIND);
    found[6] = f32(NO_LEAF == 0xffffffffu);
    found[7] = f32(MAX_DEPTH);
    found[8] = f32(SAMPLING_WORKGROUP);
    found[9] = MAX_CHANNEL;
    var harmonics = HARMONICS;
    for (var i = 0u; i < 25u; i++) {
        found[10u + i] = harmonics[i];
    }
}
";

    #[test]
    fn shaders_find_every_field_of_fields_and_every_constant() {
        let entries = BindGroupLayoutEntries::single(ShaderStages::COMPUTE, uniform_buffer::<FieldUniform>(false));
        let layout = BindGroupLayoutDescriptor::new("layout_test", &entries);
        let octree = include_str!("../../shaders/octree.wgsl");
        let begin = octree.find("struct Field").unwrap();
        let end = begin + octree[begin..].find('}').unwrap() + 1;
        let shader = SHADER.replace("STRUCT", &octree[begin..end]);
        let found: [f32; 35] = read_back(shader, layout, |device, queue, run| {
            let mut field = UniformBuffer::from(FieldUniform { depth: 1, table_level: 2, row: 3 });
            field.write_buffer(device, queue);
            run(&[field.binding().unwrap()]);
        });
        assert_eq!(found[..3], [1.0, 2.0, 3.0]);
        let kinds = [crate::gpu::records::BRICK, crate::gpu::records::INNER, crate::gpu::records::LEAF];
        assert_eq!(found[3..6].iter().map(|kind| kind.to_bits()).collect::<Vec<_>>(), kinds);
        let workgroup = crate::gpu::SAMPLING_WORKGROUP as f32;
        assert_eq!(
            found[6..10],
            [1.0, plenoctree::MAX_DEPTH as f32, workgroup, plenoctree::sampling::MAX_CHANNEL as f32]
        );
        assert_eq!(found[10..], plenoctree::Basis::FACTORS.map(|factor| factor as f32));
    }
}
