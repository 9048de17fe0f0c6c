//! The pictures that the passes of a view hand on.

use bevy::{
    camera::{MainPassResolutionOverride, Viewport},
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
/// Which prop posterises a pixel.
pub(super) const OWNER_FORMAT: TextureFormat = TextureFormat::R16Float;
/// Where a prop is.
pub(super) const DISTANCE_FORMAT: TextureFormat = TextureFormat::Rg16Float;

/// The pictures of one view, as large as its viewport.
#[derive(Component)]
pub(super) struct PropTextures {
    /// The props alone: colour weighed by opacity, and opacity.
    pub layer: TextureView,
    /// 1 + index of the prop that posterises the pixel, 0 for none.
    pub owner: TextureView,
    /// What `pack_distance` of `view.wgsl` makes.
    pub distance: TextureView,
    /// The composite, before and after every iteration of the filter.
    pub even: TextureView,
    /// The composite, in the middle of an iteration.
    pub odd: TextureView,
}

/// The part of a view's target that its main pass draws to, in pixels; `None` if there is nothing of it.
pub(super) fn drawn_viewport(
    camera: &ExtractedCamera,
    resolution: Option<&MainPassResolutionOverride>,
) -> Option<Viewport> {
    let viewport = camera.viewport.clone().or_else(|| {
        let physical_size = camera.physical_viewport_size?;
        Some(Viewport { physical_size, ..default() })
    });
    Viewport::from_viewport_and_override(viewport.as_ref(), resolution)
        .filter(|viewport| viewport.physical_size.min_element() > 0)
}

pub(super) fn prepare_textures(
    mut commands: Commands,
    mut cache: ResMut<TextureCache>,
    device: Res<RenderDevice>,
    views: Query<(Entity, &ExtractedCamera, Option<&MainPassResolutionOverride>, &VisibleProps)>,
) {
    for (entity, camera, resolution, visible) in &views {
        let (Some(viewport), false) = (drawn_viewport(camera, resolution), visible.0.is_empty()) else {
            commands.entity(entity).remove::<PropTextures>();
            continue;
        };
        let size = viewport.physical_size;
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
            distance: texture("plenoctree_distance", DISTANCE_FORMAT),
            even: texture("plenoctree_even", LAYER_FORMAT),
            odd: texture("plenoctree_odd", LAYER_FORMAT),
        };
        commands.entity(entity).insert(textures);
    }
}
