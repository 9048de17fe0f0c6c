//! The textures that describe the pixels at the edges of props.

use bevy::{
    prelude::*,
    render::{
        render_resource::{
            BlendState, ColorTargetState, CompareFunction, DepthStencilState, TextureFormat, TextureView,
        },
        renderer::RenderDevice,
    },
};

use crate::render::{
    attachment::depth_test,
    fullscreen::target,
    view::{DEPTH_FORMAT, LAYER_FORMAT, ViewMemory, ViewProps},
};

pub(super) const OUTLINE_FORMAT: TextureFormat = TextureFormat::Rg16Uint;
/// Its values are bits. Unlike integers, this format can be blended, so that two props can write to one pixel.
const COVERAGE_FORMAT: TextureFormat = TextureFormat::Rgba8Unorm;

/// Eight half floats.
pub(super) const PLACES_FORMAT: TextureFormat = TextureFormat::Rgba32Uint;

/// The edges of props. A component of views in which any of them are smooth.
#[derive(Component)]
pub(in crate::render) struct EdgeTextures {
    /// The owners that may cover parts of a pixel. See `outline.wgsl`.
    pub outline: TextureView,
    /// The parts. See `coverage.wgsl`.
    pub coverage: TextureView,
    /// What rays see of the pixel's owner, and of the other owner. See `coverage.wgsl`.
    pub colors: [TextureView; 2],
    /// Where rays reach the owner of the pixel, in views where props overlap. See `coverage.wgsl`.
    pub places: Option<TextureView>,
    /// A depth that [`mask_test`] compares, so that no fragment shader runs elsewhere.
    pub mask: TextureView,
}

impl EdgeTextures {
    /// Returns the textures that the outline pass draws to: the outline, then those of the coverage.
    pub fn targets(&self) -> [&TextureView; 4] {
        let [own, other] = &self.colors;
        [&self.outline, &self.coverage, own, other]
    }

    /// Returns all textures.
    pub fn views(&self) -> impl Iterator<Item = &TextureView> {
        self.targets().into_iter().chain([&self.mask]).chain(&self.places)
    }
}

/// Returns the depth state of passes that run only for pixels at the edges of props.
pub(in crate::render) fn mask_test() -> DepthStencilState {
    depth_test(DEPTH_FORMAT, false, CompareFunction::Less)
}

/// Returns the targets of pipelines that write the coverage.
pub(super) fn coverage_targets(blend: Option<BlendState>) -> [ColorTargetState; 3] {
    [COVERAGE_FORMAT, LAYER_FORMAT, LAYER_FORMAT].map(|format| target(format, blend))
}

pub(super) fn prepare_textures(
    mut commands: Commands,
    device: Res<RenderDevice>,
    mut views: Query<(Entity, &ViewProps, &mut ViewMemory)>,
) {
    for (entity, props, mut memory) in &mut views {
        let textures = props.viewport_size().filter(|_| props.smooths_edges()).and_then(|size| {
            let mut texture = |label, format| memory.view(&device, label, format, size);
            Some(EdgeTextures {
                outline: texture("plenoctree_outline", OUTLINE_FORMAT)?,
                coverage: texture("plenoctree_coverage", COVERAGE_FORMAT)?,
                colors: [
                    texture("plenoctree_own_rays", LAYER_FORMAT)?,
                    texture("plenoctree_other_rays", LAYER_FORMAT)?,
                ],
                places: if props.has_overlaps() {
                    Some(texture("plenoctree_edge_places", PLACES_FORMAT)?)
                } else {
                    None
                },
                mask: texture("plenoctree_edge_mask", DEPTH_FORMAT)?,
            })
        });
        match textures {
            Some(textures) => commands.entity(entity).insert(textures),
            None => commands.entity(entity).remove::<EdgeTextures>(),
        };
    }
}
