//! The pictures that the passes of a view hand on.

use bevy::{
    prelude::*,
    render::{
        camera::ExtractedCamera,
        render_resource::{Extent3d, TextureDescriptor, TextureDimension, TextureFormat, TextureUsages, TextureView},
        renderer::RenderDevice,
        texture::TextureCache,
    },
};

use super::extract::VisibleProps;

/// Colour and opacity: half floats, since eight bits after each pass of the filter would move labels.
pub(super) const LAYER_FORMAT: TextureFormat = TextureFormat::Rgba16Float;
/// Which prop is in front, and where.
pub(super) const OWNER_FORMAT: TextureFormat = TextureFormat::Rgba16Float;

/// The pictures of one view, as large as its viewport.
#[derive(Component)]
pub(super) struct PropTextures {
    /// The props alone: colour weighed by opacity, and opacity.
    pub layer: TextureView,
    /// What `pack_owner` of `view.wgsl` makes.
    pub owner: TextureView,
    /// The composite, before and after every iteration of the filter.
    pub even: TextureView,
    /// The composite, in the middle of an iteration.
    pub odd: TextureView,
}

pub(super) fn prepare_textures(
    mut commands: Commands,
    mut cache: ResMut<TextureCache>,
    device: Res<RenderDevice>,
    views: Query<(Entity, &ExtractedCamera, &VisibleProps)>,
) {
    for (entity, camera, visible) in &views {
        let (Some(size), false) = (camera.physical_viewport_size, visible.0.is_empty()) else {
            commands.entity(entity).remove::<PropTextures>();
            continue;
        };
        let mut texture = |label, format| {
            let descriptor = TextureDescriptor {
                label: Some(label),
                size: Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: TextureDimension::D2,
                format,
                usage: TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            };
            cache.get(&device, descriptor).default_view
        };
        let textures = PropTextures {
            layer: texture("plenoctree_layer", LAYER_FORMAT),
            owner: texture("plenoctree_owner", OWNER_FORMAT),
            even: texture("plenoctree_even", LAYER_FORMAT),
            odd: texture("plenoctree_odd", LAYER_FORMAT),
        };
        commands.entity(entity).insert(textures);
    }
}
