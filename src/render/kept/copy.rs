//! Copies of the scene.

use bevy::{
    prelude::*,
    render::{
        render_resource::{Extent3d, TextureDescriptor, TextureDimension, TextureFormat, TextureUsages, TextureView},
        renderer::RenderDevice,
    },
};

/// The scene of the previous frame and, once the two have been compared, that of this one.
pub(super) struct SceneCopy {
    size: UVec2,
    views: [TextureView; 2],
    /// The one that was written last.
    latest: usize,
}

impl SceneCopy {
    pub fn new(device: &RenderDevice, size: UVec2, format: TextureFormat) -> Self {
        let views = [(); 2].map(|()| {
            let texture = device.create_texture(&TextureDescriptor {
                label: Some("plenoctree_scene_copy"),
                size: Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: TextureDimension::D2,
                format,
                usage: TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            });
            texture.create_view(&default())
        });
        Self { size, views, latest: 0 }
    }

    pub fn size(&self) -> UVec2 {
        self.size
    }

    pub fn views(&self) -> &[TextureView; 2] {
        &self.views
    }

    /// Returns the index of the texture that was written last.
    pub fn latest(&self) -> usize {
        self.latest
    }

    /// Returns the other texture, for writing it.
    pub fn swap(&mut self) -> &TextureView {
        self.latest = 1 - self.latest;
        &self.views[self.latest]
    }
}
