//! Textures that store arrays. Unlike buffers, they can be bound whole, regardless of their size.
//!
//! Their layers are always written whole. Before a layer is first written in part, wgpu clears it.

use std::ops::Range;

use bevy::render::{
    render_resource::{
        Extent3d, Origin3d, TexelCopyBufferLayout, TexelCopyTextureInfo, Texture, TextureAspect, TextureDescriptor,
        TextureDimension, TextureFormat, TextureUsages, TextureView, TextureViewDescriptor, TextureViewDimension,
    },
    renderer::{RenderDevice, RenderQueue},
};

/// The maximum width of a texture, in texels.
const MOST_WIDTH: u32 = 512;
/// The maximum number of layers of a texture.
const MOST_LAYERS: u32 = 256;
/// The minimum number of rows in a layer of a texture with several layers. Drivers store rows in groups.
const FEWEST_ROWS: u32 = 4;

/// How a device stores arrays: element `i` is the texel in column `i % width` of row `i / width`. An equal number of
/// rows makes a layer.
#[derive(Clone, Copy)]
pub(super) struct Grid {
    width: u32,
    most_rows: u32,
    most_layers: u32,
}

impl Grid {
    pub fn new(limits: &wgpu::Limits) -> Self {
        let most_rows = limits.max_texture_dimension_2d.max(1);
        // A power of two, so that shaders do not have to divide.
        let width = 1 << MOST_WIDTH.min(most_rows).ilog2();
        Self { width, most_rows, most_layers: limits.max_texture_array_layers.clamp(1, MOST_LAYERS) }
    }

    /// Returns the base-2 logarithm of the width.
    pub fn row_log2(self) -> u32 {
        self.width.ilog2()
    }

    /// Returns the maximum number of elements: those of the largest texture with one layer that is at most 8192 texels
    /// wide.
    pub fn most_texels(self) -> u64 {
        let width = 1 << self.most_rows.min(8192).ilog2();
        let rows = u64::from(self.most_rows);
        (rows * width).min(rows * u64::from(self.width) * u64::from(self.most_layers))
    }

    /// Returns the layers of an array of `texels` elements.
    pub fn layers(self, texels: usize) -> Layers {
        let rows = texels.div_ceil(self.width as usize).max(1) as u32;
        if rows <= FEWEST_ROWS {
            // A short array does not need a full row.
            let width = if rows == 1 { texels.max(1) as u32 } else { self.width };
            return Layers { width, rows, count: 1 };
        }
        let height = rows.div_ceil(self.most_layers).next_power_of_two().max(FEWEST_ROWS);
        Layers { width: self.width, rows: height, count: rows.div_ceil(height) }
    }
}

/// The size of a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layers {
    pub width: u32,
    /// The number of rows in each layer.
    pub rows: u32,
    pub count: u32,
}

impl Layers {
    /// Returns the layers of a cube of texels, with the last axis varying fastest.
    pub fn cube(side: u32) -> Self {
        Self { width: side, rows: side, count: side }
    }

    /// Returns the base-2 logarithm of the number of rows in a layer, rounded up.
    pub fn rows_log2(self) -> u32 {
        self.rows.next_power_of_two().ilog2()
    }

    /// Returns the number of texels in a layer.
    pub fn texels(self) -> usize {
        self.width as usize * self.rows as usize
    }

    /// Creates the texture.
    pub fn texture(self, device: &RenderDevice, label: &'static str, format: TextureFormat) -> Texture {
        device.create_texture(&TextureDescriptor {
            label: Some(label),
            size: Extent3d { width: self.width, height: self.rows, depth_or_array_layers: self.count },
            mip_level_count: 1,
            sample_count: 1,
            dimension: TextureDimension::D2,
            format,
            usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
            view_formats: &[],
        })
    }
}

/// Returns the view of all layers, also of a single one.
pub(super) fn view(texture: &Texture) -> TextureView {
    texture.create_view(&TextureViewDescriptor { dimension: Some(TextureViewDimension::D2Array), ..Default::default() })
}

/// Writes whole layers. `bytes` holds their texels.
pub(super) fn write(queue: &RenderQueue, texture: &Texture, layers: Range<u32>, bytes: &[u8]) {
    let Extent3d { width, height, .. } = texture.size();
    let texel = texture.format().block_copy_size(None).unwrap_or(1);
    queue.write_texture(
        TexelCopyTextureInfo {
            texture,
            mip_level: 0,
            origin: Origin3d { x: 0, y: 0, z: layers.start },
            aspect: TextureAspect::All,
        },
        bytes,
        TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(width * texel), rows_per_image: Some(height) },
        Extent3d { width, height, depth_or_array_layers: layers.end - layers.start },
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every array that a device may hold fits its limits, and wastes little.
    #[test]
    fn arrays_fit_their_layers() {
        for (side, array_layers) in [(256, 256), (300, 256), (2048, 256), (4096, 64), (8192, 256), (16384, 2048)] {
            let limits = wgpu::Limits {
                max_texture_dimension_2d: side,
                max_texture_array_layers: array_layers,
                ..wgpu::Limits::default()
            };
            let grid = Grid::new(&limits);
            let most = grid.most_texels() as usize;
            assert_eq!(most, side as usize * (1 << side.min(8192).ilog2()));
            for texels in [0, 1, 7, 513, 2047, 2049, 100_000, 3_722_804, most / 3, most].map(|texels| texels.min(most))
            {
                let layers = grid.layers(texels);
                let held = layers.texels() * layers.count as usize;
                assert!(layers.width <= side && layers.rows <= side && layers.count <= array_layers, "{layers:?}");
                assert!(held >= texels, "{texels} in {layers:?}");
                assert!(held < texels + texels / 64 + 4 * grid.width as usize, "{texels} in {layers:?}");
            }
        }
    }
}
