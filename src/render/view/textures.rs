//! The textures that a view's passes read and write.

use bevy::{
    camera::{MainPassResolutionOverride, Viewport},
    core_pipeline::prepass::MOTION_VECTOR_PREPASS_FORMAT,
    prelude::*,
    render::{
        camera::ExtractedCamera,
        render_resource::{RenderPassColorAttachment, TextureFormat, TextureView},
        renderer::RenderDevice,
    },
};

use super::memory::ViewMemory;
use crate::{
    quality::PropQuality,
    render::{
        attachment::{cleared, kept},
        extract::VisibleProps,
        refine::{RaysOf, batches_size},
    },
};

/// The format of color and opacity: half floats, because 8 bits per channel would change labels.
pub(in crate::render) const LAYER_FORMAT: TextureFormat = TextureFormat::Rgba16Float;
/// The format of the owner of a pixel.
pub(in crate::render) const OWNER_FORMAT: TextureFormat = TextureFormat::Rg16Float;
/// The format of the props' depth, which is reversed like the scene's.
pub(in crate::render) const DEPTH_FORMAT: TextureFormat = TextureFormat::Depth32Float;

/// The format of what the check pass finds.
pub(in crate::render) const GAP_FORMAT: TextureFormat = TextureFormat::R16Uint;

/// The format of motion vectors, as in Bevy's prepass.
pub(in crate::render) const MOTION_FORMAT: TextureFormat = MOTION_VECTOR_PREPASS_FORMAT;

/// The output of the volume pass: the props alone, without the scene.
pub(in crate::render) struct Layer {
    /// Encoded sRGB premultiplied by opacity, and opacity.
    pub color: TextureView,
    /// The owner, as packed by `pack_owner` of `view.wgsl`.
    pub owner: TextureView,
    pub depth: TextureView,
    /// How solid props have moved since the previous frame, as a fraction of the viewport. Only for cameras with motion
    /// vectors.
    pub motion: Option<TextureView>,
}

impl Layer {
    /// Returns the color attachments of passes that draw to the layer. They are cleared, or hold what was drawn before.
    pub fn attachments(&self, clears: bool) -> Vec<Option<RenderPassColorAttachment<'_>>> {
        let attachment = if clears { cleared } else { kept };
        let mut attachments = vec![attachment(&self.color), attachment(&self.owner)];
        attachments.extend(self.motion.as_ref().map(attachment));
        attachments
    }

    /// Returns its textures.
    pub fn views(&self) -> impl Iterator<Item = &TextureView> {
        [&self.color, &self.owner, &self.depth].into_iter().chain(&self.motion)
    }
}

/// The textures of a view, which have the size of its viewport.
#[derive(Component)]
pub(in crate::render) struct ViewTextures {
    pub layer: Layer,
    /// What the layer is made of if not every pixel gets a ray.
    pub sparse: Option<Sparse>,
}

/// The results of the rays of the grid, and of those of the batches.
pub(in crate::render) struct Sparse {
    pub grid: Layer,
    pub batches: Layer,
    /// What the check pass finds about each gap, as `batch.wgsl` says.
    pub gaps: TextureView,
}

impl ViewTextures {
    /// Returns the textures of a viewport of `size`, or `None` if there is no memory for them.
    fn new(memory: &mut ViewMemory, device: &RenderDevice, visible: &VisibleProps, size: UVec2) -> Option<Self> {
        let mut layer = |size| {
            let mut texture = |label, format| memory.view(device, label, format, size);
            Some(Layer {
                color: texture("plenoctree_layer", LAYER_FORMAT)?,
                owner: texture("plenoctree_owner", OWNER_FORMAT)?,
                depth: texture("plenoctree_depth", DEPTH_FORMAT)?,
                motion: if visible.has_motion { Some(texture("plenoctree_motion", MOTION_FORMAT)?) } else { None },
            })
        };
        let spacing = spacing(&visible.quality);
        let (grid, batches) = (grid_size(size, spacing), batches_size(size, spacing));
        let layers = if spacing > 1 { Some((layer(grid)?, layer(batches)?)) } else { None };
        let layer = layer(size)?;
        let sparse = match layers {
            Some((of_grid, batches)) => {
                let gaps = memory.view(device, "plenoctree_gaps", GAP_FORMAT, grid)?;
                Some(Sparse { grid: of_grid, batches, gaps })
            }
            None => None,
        };
        Some(Self { layer, sparse })
    }

    /// Returns the layer that the volume pass draws some rays to.
    pub fn volume(&self, rays: RaysOf) -> Option<&Layer> {
        match (rays, &self.sparse) {
            (RaysOf::Grid, None) => Some(&self.layer),
            (RaysOf::Grid, Some(sparse)) => Some(&sparse.grid),
            (RaysOf::Batches, sparse) => sparse.as_ref().map(|sparse| &sparse.batches),
        }
    }

    /// Returns the textures of the layer, and of all that it is made of.
    pub fn layers(&self) -> impl Iterator<Item = &TextureView> {
        let sparse = self.sparse.iter().flat_map(|sparse| {
            [&sparse.grid, &sparse.batches].into_iter().flat_map(Layer::views).chain([&sparse.gaps])
        });
        self.layer.views().chain(sparse)
    }
}

/// Returns the part of a view's target that its main pass draws to, in pixels, or `None` if it is empty.
pub(in crate::render) fn drawn_viewport(
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
    device: Res<RenderDevice>,
    mut views: Query<(
        Entity,
        Option<&ExtractedCamera>,
        Option<&MainPassResolutionOverride>,
        &VisibleProps,
        &mut ViewMemory,
    )>,
) {
    for (entity, camera, resolution, visible, mut memory) in &mut views {
        let viewport = camera.filter(|_| !visible.is_empty()).and_then(|camera| drawn_viewport(camera, resolution));
        let textures = viewport.and_then(|view| ViewTextures::new(&mut memory, &device, visible, view.physical_size));
        match textures {
            Some(textures) => commands.entity(entity).insert(textures),
            None => commands.entity(entity).remove::<ViewTextures>(),
        };
    }
}

/// Returns the number of pixels per ray of the grid, along each axis.
pub(in crate::render) fn spacing(quality: &PropQuality) -> u32 {
    if quality.error > 0.0 { quality.spacing } else { 1 }
}

/// Returns the number of rays of the grid in a viewport of `size`, along each axis.
pub(in crate::render) fn grid_size(size: UVec2, spacing: u32) -> UVec2 {
    (size + spacing - 1) / spacing
}
