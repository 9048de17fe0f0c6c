//! Copies of the scene.

use bevy::{
    prelude::*,
    render::{
        render_resource::{TextureFormat, TextureView},
        renderer::RenderDevice,
    },
};

use crate::render::view::view_texture;

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
            let texture = device.create_texture(&view_texture("plenoctree_scene_copy", format, size));
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
