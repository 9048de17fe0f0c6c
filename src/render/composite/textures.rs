//! The textures that the composite pass writes and the filter works on.

use bevy::{
    prelude::*,
    render::{
        render_resource::{TextureFormat, TextureView},
        renderer::RenderDevice,
    },
};

use crate::{
    gpu::WordTextures,
    render::view::{ViewMemory, ViewProps, view_texture},
};

/// The color, owner and CIELAB of a pixel. See `filter_texel.wgsl`.
pub(in crate::render) const COMPOSITE_FORMAT: TextureFormat = TextureFormat::Rgba32Uint;

/// The composite. A component of views in which anything is posterized.
#[derive(Component)]
pub(in crate::render) struct CompositeTextures {
    /// Before and after each iteration of the filter.
    pub even: TextureView,
    /// Halfway through an iteration.
    pub odd: TextureView,
}

pub(super) fn prepare_textures(
    mut commands: Commands,
    device: Res<RenderDevice>,
    words: Res<WordTextures>,
    mut views: Query<(Entity, &ViewProps, &mut ViewMemory)>,
) {
    for (entity, props, mut memory) in &mut views {
        let textures = props.viewport_size().filter(|_| props.posterizes()).and_then(|size| {
            let mut texture = |label| {
                let mut descriptor = view_texture(label, COMPOSITE_FORMAT, size);
                descriptor.usage |= words.usage();
                Some(memory.texture(&device, descriptor)?.default_view)
            };
            Some(CompositeTextures { even: texture("plenoctree_even")?, odd: texture("plenoctree_odd")? })
        });
        match textures {
            Some(textures) => commands.entity(entity).insert(textures),
            None => commands.entity(entity).remove::<CompositeTextures>(),
        };
    }
}
