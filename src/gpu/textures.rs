//! Textures that store arrays. Unlike buffers, they can be bound whole, whatever their size.

use bevy::render::{
    render_resource::{
        Extent3d, Origin3d, TexelCopyBufferLayout, TexelCopyTextureInfo, Texture, TextureAspect, TextureDescriptor,
        TextureDimension, TextureFormat, TextureUsages,
    },
    renderer::{RenderDevice, RenderQueue},
};
use half::f16;
use plenoctree::PlenOctree;

use super::payload::Payload;

/// The maximum width of a texture, in texels.
const MOST_WIDTH: u32 = 8192;
/// The number of texels per upload. The queue copies each upload, so this limits the memory in use.
const BAND: usize = 1 << 22;

/// An array stored in the rows of a texture: element `i` is the texel in column `i % width` of row `i / width`.
#[derive(Clone, Copy)]
pub(super) struct Row {
    width: u32,
    most_rows: u32,
}

impl Row {
    pub fn new(limits: &wgpu::Limits) -> Self {
        let most_rows = limits.max_texture_dimension_2d.max(1);
        // A power of two, so that shaders do not have to divide.
        Self { width: 1 << MOST_WIDTH.min(most_rows).ilog2(), most_rows }
    }

    /// Returns the base-2 logarithm of the width.
    pub fn log2(self) -> u32 {
        self.width.ilog2()
    }

    /// Returns the maximum number of elements.
    pub fn most_texels(self) -> u64 {
        u64::from(self.width) * u64::from(self.most_rows)
    }

    pub fn upload_words(
        self,
        device: &RenderDevice,
        queue: &RenderQueue,
        label: &'static str,
        words: &[[u32; 4]],
    ) -> Texture {
        let texture = self.texture(device, label, TextureFormat::Rgba32Uint, words.len());
        self.write(queue, &texture, 0, bytemuck::cast_slice(words), 16);
        texture
    }

    /// Uploads densities. Those of packed fields are numbers that half floats hold, and take half the memory.
    pub fn upload_densities(self, device: &RenderDevice, queue: &RenderQueue, field: &PlenOctree) -> Texture {
        let label = "plenoctree_densities";
        let densities = field.densities();
        if field.codebook().is_none() {
            let texture = self.texture(device, label, TextureFormat::R32Float, densities.len());
            self.write(queue, &texture, 0, bytemuck::cast_slice(densities), 4);
            return texture;
        }
        let texture = self.texture(device, label, TextureFormat::R16Float, densities.len());
        let halves: Vec<f16> = densities.iter().map(|density| f16::from_f32(*density)).collect();
        self.write(queue, &texture, 0, bytemuck::cast_slice(&halves), 2);
        texture
    }

    /// Uploads the coefficients, and the codebook of a packed field.
    pub fn upload_coefficients(
        self,
        device: &RenderDevice,
        queue: &RenderQueue,
        field: &PlenOctree,
    ) -> (Texture, Option<Texture>) {
        let payload = Payload::of(field);
        let Some(codebook) = field.codebook() else {
            return (self.upload_each(device, queue, payload, &field.coefficients()), None);
        };
        let leaves = Payload::pack_leaves(codebook);
        let texture = self.texture(device, "plenoctree_coefficients", TextureFormat::Rg32Uint, leaves.len());
        self.write(queue, &texture, 0, bytemuck::cast_slice(&leaves), 8);
        let rows = payload.pack_rows(codebook);
        let table = self.texture(device, "plenoctree_codebook", TextureFormat::Rgba32Uint, rows.len() / 4);
        self.write(queue, &table, 0, bytemuck::cast_slice(&rows), 16);
        (texture, Some(table))
    }

    /// Uploads the coefficients of every leaf in bands, so that no more than one band is in memory twice.
    fn upload_each(
        self,
        device: &RenderDevice,
        queue: &RenderQueue,
        payload: Payload,
        coefficients: &[f16],
    ) -> Texture {
        let leaves = coefficients.len() / payload.basis.coefficients();
        let texels = payload.texels();
        let texture = self.texture(device, "plenoctree_coefficients", TextureFormat::Rgba32Uint, leaves * texels);
        // `width` leaves fill whole rows, and so does every band.
        let width = self.width as usize;
        let rows = (BAND / (width * texels)).max(1);
        for (band, leaves) in coefficients.chunks(rows * width * payload.basis.coefficients()).enumerate() {
            let words = payload.pack(leaves);
            self.write(queue, &texture, (band * rows * texels) as u32, bytemuck::cast_slice(&words), 16);
            // Submitting lets the queue free its copy.
            queue.submit([]);
        }
        texture
    }

    fn texture(self, device: &RenderDevice, label: &'static str, format: TextureFormat, texels: usize) -> Texture {
        let rows = texels.div_ceil(self.width as usize).max(1) as u32;
        // A short array does not need a full row.
        let width = if rows == 1 { texels.max(1) as u32 } else { self.width };
        device.create_texture(&TextureDescriptor {
            label: Some(label),
            size: Extent3d { width, height: rows, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: TextureDimension::D2,
            format,
            usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
            view_formats: &[],
        })
    }

    /// Writes texels, starting at the beginning of `row`.
    fn write(self, queue: &RenderQueue, texture: &Texture, row: u32, bytes: &[u8], texel: usize) {
        let row_bytes = self.width as usize * texel;
        let whole = bytes.len() / row_bytes;
        let (body, rest) = bytes.split_at(whole * row_bytes);
        write(queue, texture, row, [self.width, whole as u32, 1], body, texel);
        write(queue, texture, row + whole as u32, [(rest.len() / texel) as u32, 1, 1], rest, texel);
    }
}

/// Uploads a cube of texels, with the last axis varying fastest.
pub(super) fn upload_table(device: &RenderDevice, queue: &RenderQueue, table: &[[u32; 4]], level: u32) -> Texture {
    let side = 1 << level;
    let texture = device.create_texture(&TextureDescriptor {
        label: Some("plenoctree_table"),
        size: Extent3d { width: side, height: side, depth_or_array_layers: side },
        mip_level_count: 1,
        sample_count: 1,
        dimension: TextureDimension::D3,
        format: TextureFormat::Rgba32Uint,
        usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
        view_formats: &[],
    });
    write(queue, &texture, 0, [side; 3], bytemuck::cast_slice(table), 16);
    texture
}

fn write(queue: &RenderQueue, texture: &Texture, y: u32, [width, height, depth]: [u32; 3], bytes: &[u8], texel: usize) {
    if bytes.is_empty() {
        return;
    }
    queue.write_texture(
        TexelCopyTextureInfo { texture, mip_level: 0, origin: Origin3d { x: 0, y, z: 0 }, aspect: TextureAspect::All },
        bytes,
        TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(width * texel as u32), rows_per_image: Some(height) },
        Extent3d { width, height, depth_or_array_layers: depth },
    );
}
