//! The memory of views. Where there is too little, a view draws no props instead of ending the app.

use bevy::{
    camera::MainPassResolutionOverride,
    prelude::*,
    render::{
        camera::ExtractedCamera,
        render_resource::{
            Extent3d, Texture, TextureDescriptor, TextureDimension, TextureFormat, TextureUsages, TextureView,
        },
        renderer::RenderDevice,
        sync_world::MainEntity,
        texture::CachedTexture,
    },
};

use super::{
    props::ViewProps,
    textures::{ViewTextures, drawn_viewport},
};
use crate::{
    gpu::{Allocator, FieldReports, ViewTooLarge},
    quality::PropQuality,
    render::{composite::CompositeTextures, extract::VisibleProps},
};

/// The textures that the passes of a view request in every frame. Bevy's `TextureCache` would hand out textures that
/// there was no memory for.
#[derive(Component, Default)]
pub(crate) struct ViewMemory {
    textures: Vec<KeptTexture>,
    allocator: Allocator,
    needs: Needs,
    /// What there was too little memory for.
    shortage: Option<ViewTooLarge>,
}

struct KeptTexture {
    descriptor: TextureDescriptor<'static>,
    texture: Texture,
    view: TextureView,
    is_taken: bool,
    /// The number of frames since it was last taken.
    idle: u32,
}

/// What determines the memory that a view needs. If it changes, there may be enough.
#[derive(Default, PartialEq)]
struct Needs {
    size: UVec2,
    props: usize,
    quality: PropQuality,
}

impl ViewMemory {
    /// For how many frames textures are kept that nothing takes.
    const KEPT_FRAMES: u32 = 2;

    /// Returns a texture that nothing else takes in this frame, or `None` if there is no memory for it.
    pub fn texture(&mut self, device: &RenderDevice, descriptor: TextureDescriptor<'static>) -> Option<CachedTexture> {
        let is_free = |kept: &KeptTexture| !kept.is_taken && kept.descriptor == descriptor;
        let index = match self.textures.iter().position(is_free) {
            Some(index) => index,
            None => {
                let (texture, view) = self.create(device, || {
                    let texture = device.create_texture(&descriptor);
                    let view = texture.create_view(&default());
                    (texture, view)
                })?;
                self.textures.push(KeptTexture { descriptor, texture, view, is_taken: false, idle: 0 });
                self.textures.len() - 1
            }
        };
        let kept = &mut self.textures[index];
        (kept.is_taken, kept.idle) = (true, 0);
        Some(CachedTexture { texture: kept.texture.clone(), default_view: kept.view.clone() })
    }

    /// Returns a texture of `size` pixels that passes write and read, or `None` if there is no memory for it.
    pub fn view(
        &mut self,
        device: &RenderDevice,
        label: &'static str,
        format: TextureFormat,
        size: UVec2,
    ) -> Option<TextureView> {
        Some(self.texture(device, view_texture(label, format, size))?.default_view)
    }

    /// Returns what `create` creates, or `None` if there is no memory for it. The view keeps it itself.
    pub fn create<T>(&mut self, device: &RenderDevice, create: impl FnOnce() -> T) -> Option<T> {
        self.allocator.create(device, create)
    }

    /// Returns what there is too little memory for.
    #[cfg(feature = "headless")]
    pub fn shortage(&self) -> Option<&ViewTooLarge> {
        self.shortage.as_ref()
    }

    /// Begins a frame: frees the textures that are not used anymore.
    fn begin(&mut self) {
        self.textures.retain_mut(|kept| {
            kept.is_taken = false;
            kept.idle += 1;
            kept.idle <= Self::KEPT_FRAMES
        });
    }
}

/// Describes a texture of `size` pixels that passes write and read.
pub(in crate::render) fn view_texture(
    label: &'static str,
    format: TextureFormat,
    size: UVec2,
) -> TextureDescriptor<'static> {
    TextureDescriptor {
        label: Some(label),
        size: Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: TextureDimension::D2,
        format,
        usage: TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    }
}

/// Empties the views for which there is no memory. From time to time, and when they need something else, they try
/// again.
pub(super) fn skip_views(
    mut views: Query<(
        Option<&ExtractedCamera>,
        Option<&MainPassResolutionOverride>,
        &mut VisibleProps,
        &mut ViewMemory,
    )>,
) {
    for (camera, resolution, mut visible, mut memory) in &mut views {
        memory.begin();
        let viewport = camera.and_then(|camera| drawn_viewport(camera, resolution));
        let size = viewport.map_or(UVec2::ZERO, |viewport| viewport.physical_size);
        let needs = Needs { size, props: visible.props.len(), quality: visible.quality };
        if memory.needs != needs || !memory.allocator.is_pausing() {
            memory.needs = needs;
            memory.allocator.try_again();
        } else {
            visible.clear();
        }
    }
}

/// Empties the views for which there was no memory in this frame, and gives back what they got.
pub(super) fn report_shortages(
    mut commands: Commands,
    reports: Res<FieldReports>,
    mut views: Query<(Entity, &MainEntity, &mut ViewProps, &mut ViewMemory)>,
) {
    for (view, camera, mut props, mut memory) in &mut views {
        let ViewMemory { textures, allocator, needs, shortage } = &mut *memory;
        if let Some(error) = allocator.error() {
            props.clear();
            textures.clear();
            commands.entity(view).remove::<(ViewTextures, CompositeTextures)>();
            if shortage.is_none() {
                let too_large = ViewTooLarge { size: needs.size };
                error!("camera {} draws no props: {too_large}: {error}", camera.id());
                reports.view(camera.id(), too_large.clone());
                *shortage = Some(too_large);
            }
        } else {
            *shortage = None;
        }
    }
}
