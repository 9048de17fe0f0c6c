//! The size of a field on the GPU, its textures and its bind group.

use std::ops::Range;

use bevy::{
    ecs::system::SystemParam,
    prelude::*,
    render::{
        render_resource::{BindGroup, BindGroupEntries, BufferUsages, PipelineCache, Texture},
        renderer::{RenderDevice, RenderQueue},
    },
};
use glam::DVec3;
use plenoctree::{Codebook, PlenOctree};

use super::{
    buffers::buffer_with,
    errors::DriverErrors,
    layout::{DENSITIES, FieldShape, FieldUniform, PACKED_DENSITIES, PACKED_WORDS, WORDS, field_layout},
    payload::Payload,
    records::Records,
    textures::{self, Grid, Layers},
};
use crate::background;

/// The error for a field that does not fit on the GPU.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the field's {what} would take {bytes} bytes of GPU memory, {}; use fewer leaves. Unless it is packed, a field is \
     smaller if you pack it, or with spherical harmonics of a lower degree",
    .limit.map_or("more than is available".into(), |limit| format!("more than the {limit} bytes that the device allows"))
)]
pub struct FieldTooLarge {
    /// The part of the field that does not fit.
    pub what: &'static str,
    /// The size of that part, in bytes.
    pub bytes: u64,
    /// The maximum size that the device allows, in bytes: that of a texture with four words per texel (one word for
    /// densities, and for packed fields a byte for densities, and two words for leaves and the codebook), whose height is
    /// `max_texture_dimension_2d`, and whose width is the same but at most 8192. `None` if the driver ran out of memory
    /// or rejected a texture: drivers do not report how much is left. The log then contains the driver's message, and the
    /// field is tried again every two seconds.
    pub limit: Option<u64>,
}

/// A level of a field in GPU memory.
pub(crate) struct GpuLevel {
    /// Holds the textures.
    pub bind_group: BindGroup,
    pub shape: FieldShape,
    /// The box around the leaves, in tree units; `None` if there are no leaves.
    pub bounds: Option<(DVec3, DVec3)>,
    pub bytes: u64,
    queue: RenderQueue,
}

impl Drop for GpuLevel {
    /// Frees the memory once the GPU has finished drawing. Otherwise, the frame would have to.
    fn drop(&mut self) {
        let (textures, bytes) = (self.bind_group.clone(), self.bytes);
        self.queue.on_submitted_work_done(move || background::discard(textures, bytes));
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
            let texels: usize = payload.texels_of_codebook(field.densities().values(), codebook).into_iter().sum();
            [("densities", leaves, 1), ("coefficients", 8 * leaves, 8), ("codebook", 8 * texels.max(1) as u64, 8)]
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
    let texels = Grid::new(limits).most_texels();
    let [densities, coefficients, codebook] = arrays(field);
    // The largest come first.
    for (what, bytes, texel) in [coefficients, densities, codebook, ("child records", 16 * children, 16)] {
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
    pub records: Records,
    /// The codebook of a packed field.
    codebook: Option<Vec<[u32; 2]>>,
}

impl LevelData {
    /// Creates the records of `field`. Visits every leaf, which takes a moment for a large field.
    pub fn new(field: PlenOctree) -> Self {
        let records = Records::new(&field, table_allowance(&field));
        let densities = field.densities().values();
        let codebook = field.codebook().map(|codebook| Payload::of(&field).pack_codebook(densities, codebook));
        Self { field, records, codebook }
    }

    /// Returns whether creating the records and packing the leaves takes little time: 2 ms if leaves are scattered.
    pub fn is_quick(field: &PlenOctree) -> bool {
        field.leaves() <= 1 << 12 && field.nodes().len() <= 1 << 11 && field.depth() <= 7
    }

    /// Returns the contents of a texture that is copied as it is, or `None` if they must be packed.
    pub fn plain(&self, texture: usize) -> Option<&[u8]> {
        match (texture, &self.codebook) {
            (0, _) => Some(bytemuck::cast_slice(&self.records.table)),
            (1, _) => Some(bytemuck::cast_slice(&self.records.children)),
            (2, _) => {
                let densities = self.field.densities();
                Some(densities.levels().unwrap_or(bytemuck::cast_slice(densities.values())))
            }
            (4, Some(codebook)) => Some(bytemuck::cast_slice(codebook)),
            _ => None,
        }
    }

    /// Packs a range of bytes of the coefficients. Bytes beyond the last leaf are 0.
    pub fn pack(&self, bytes: Range<usize>) -> Vec<u32> {
        // The leaves of which bytes are in the range, if each has this many.
        let leaves = |size: usize| {
            let [first, end] = [bytes.start / size, bytes.end.div_ceil(size)].map(|leaf| leaf.min(self.field.leaves()));
            first..end
        };
        let mut words = match self.field.codebook() {
            Some(codebook) => Payload::pack_leaves(codebook, leaves(8)),
            None => {
                let (payload, width) = (Payload::of(&self.field), self.field.basis().coefficients());
                let leaf = 16 * payload.texels();
                let Range { start, end } = leaves(leaf);
                let mut words = payload.pack(&self.field.coefficients()[start * width..end * width]);
                // The first leaf may begin before the first byte.
                words.drain(..((bytes.start - start * leaf) / 4).min(words.len()));
                words
            }
        };
        words.resize(bytes.len() / 4, 0);
        words
    }
}

impl Drop for LevelData {
    fn drop(&mut self) {
        let (records, codebook) = (std::mem::take(&mut self.records), self.codebook.take());
        let bytes = 16 * (records.table.len() + records.children.len()) as u64 + field_bytes(&self.field);
        background::discard((self.field.clone(), records, codebook), bytes);
    }
}

/// Returns the size of a field in main memory, in bytes.
pub(crate) fn field_bytes(field: &PlenOctree) -> u64 {
    let coefficients = match field.codebook() {
        None => 2 * field.basis().coefficients() * field.leaves(),
        Some(Codebook { colors, rows, luma, chroma, .. }) => {
            size_of_val(colors) + size_of_val(rows) + size_of_val(luma) + size_of_val(chroma)
        }
    };
    let densities = field.densities();
    let densities = size_of_val(densities.values()) + densities.levels().map_or(0, size_of_val);
    (32 * field.nodes().len() + densities + coefficients) as u64
}

/// A system parameter that uploads fields to GPU memory.
#[derive(SystemParam)]
pub(super) struct Uploader<'w> {
    pub device: Res<'w, RenderDevice>,
    pub queue: Res<'w, RenderQueue>,
    pipelines: Res<'w, PipelineCache>,
}

impl Uploader<'_> {
    /// Creates the textures of a level, without their contents. Fails if they are larger than the device allows. Other
    /// errors of the driver are for `errors`.
    pub fn begin(&self, data: &LevelData, errors: &mut DriverErrors) -> Result<(GpuLevel, Textures), FieldTooLarge> {
        check_arrays(&data.field, data.records.children.len() as u64, &self.device.limits())?;
        Ok(errors.watch(&self.device, || self.level(data)))
    }

    fn level(&self, data: &LevelData) -> (GpuLevel, Textures) {
        let LevelData { field, records, .. } = data;
        let payload = Payload::of(field);
        let grid = Grid::new(&self.device.limits());
        let (device, queue) = (&self.device, &self.queue);
        let [densities, coefficients, codebook] =
            arrays(field).map(|(_, bytes, texel)| grid.layers((bytes / texel) as usize));
        let layers = [
            Layers::cube(1 << records.table_level),
            grid.layers(records.children.len()),
            densities,
            coefficients,
            codebook,
        ];
        let codebook = field.codebook();
        let [shared, rows, _] =
            codebook.map_or([0; 3], |codebook| payload.texels_of_codebook(field.densities().values(), codebook));
        let uniform = FieldUniform {
            depth: records.depth,
            table_level: records.table_level,
            row: grid.row_log2(),
            record_rows: layers[1].rows_log2(),
            density_rows: layers[2].rows_log2(),
            coefficient_rows: layers[3].rows_log2(),
            codebook_rows: layers[4].rows_log2(),
            luma: shared as u32,
            chroma: (shared + rows) as u32,
            color_step: codebook.map_or(0.0, |codebook| codebook.color_step),
            table_scale: codebook.map_or(0.0, |codebook| 127.0 * codebook.table_step),
        };
        let uniform = buffer_with(device, queue, "plenoctree_field", BufferUsages::UNIFORM, &uniform);
        let (of_densities, of_leaves) =
            if codebook.is_some() { (PACKED_DENSITIES, PACKED_WORDS) } else { (DENSITIES, WORDS) };
        let mut textures = vec![
            layers[0].texture(device, "plenoctree_table", WORDS),
            layers[1].texture(device, "plenoctree_records", WORDS),
            layers[2].texture(device, "plenoctree_densities", of_densities),
            layers[3].texture(device, "plenoctree_coefficients", of_leaves),
        ];
        if codebook.is_some() {
            textures.push(layers[4].texture(device, "plenoctree_codebook", PACKED_WORDS));
        }
        let views: [_; 5] = std::array::from_fn(|index| textures::view(&textures[index.min(textures.len() - 1)]));
        let shape = FieldShape { payload, activation: field.activation(), inner_levels: records.inner_levels() };
        let bind_group = self.device.create_bind_group(
            "plenoctree_field",
            &self.pipelines.get_bind_group_layout(&field_layout()),
            &BindGroupEntries::sequential((
                uniform.as_entire_buffer_binding(),
                &views[0],
                &views[1],
                &views[2],
                &views[3],
                &views[4],
            )),
        );
        let bytes = textures.iter().map(|texture| {
            let size = texture.size();
            let texel = texture.format().block_copy_size(None).unwrap_or(0);
            u64::from(size.width) * u64::from(size.height) * u64::from(size.depth_or_array_layers) * u64::from(texel)
        });
        let level = GpuLevel {
            bind_group,
            shape,
            bounds: field.tree_bounds(),
            bytes: bytes.sum(),
            queue: RenderQueue::clone(queue),
        };
        (level, textures.into_iter().zip(layers).collect())
    }
}

/// The textures of a level: table records, child records, densities, coefficients, and the codebook of a packed field.
pub(super) type Textures = Vec<(Texture, Layers)>;

#[cfg(test)]
mod tests {
    use plenoctree::{BakeSettings, Basis, PackSettings, Packed, bake, sampling::Progress};

    use super::*;

    /// Slices hold every leaf of a packed field, and zeros behind the last.
    #[test]
    fn slices_of_packed_fields_hold_their_leaves() {
        const SLICE: usize = 256;
        for basis in [Basis::Sh1, Basis::Sh4] {
            let settings = BakeSettings { depth: 4, basis, ..Default::default() };
            let color = |at: DVec3| move |direction: DVec3| 0.5 + 0.3 * at + 0.1 * direction;
            let field = bake(&settings, |at| 30.0 * (1.0 - at.length()).max(0.0), color).unwrap();
            let packed = Packed::new(&field, &PackSettings::default(), &Progress::default()).unwrap();
            let data = LevelData::new(packed.field().clone());
            let (leaves, codebook) = (data.field.leaves(), data.field.codebook().unwrap());
            assert!(8 * leaves > 4 * SLICE);
            // Shaders find the density of a leaf in the codebook, by its byte.
            let shared: &[f32] = bytemuck::cast_slice(data.plain(4).unwrap());
            let densities = data.plain(2).unwrap().iter().map(|level| &shared[usize::from(*level)]);
            assert!(densities.eq(data.field.densities().iter()), "{basis:?}");
            let starts = (0..8 * leaves + SLICE).step_by(SLICE);
            let words: Vec<u32> = starts.flat_map(|start| data.pack(start..start + SLICE)).collect();
            let expected = codebook.colors.iter().enumerate().flat_map(|(leaf, color)| {
                let [y, u, v] = color.map(|number| number as u32);
                let [luma, chroma] = codebook.rows.get(leaf).map_or([0; 2], |rows| rows.map(u32::from));
                [(y & 0xfff) | (u & 0x3ff) << 12 | v << 22, luma | chroma << 16]
            });
            assert!(words.iter().copied().take(2 * leaves).eq(expected), "{basis:?}");
            assert!(words[2 * leaves..].iter().all(|word| *word == 0), "{basis:?}");
        }
    }
}
