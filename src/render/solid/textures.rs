//! The textures that the solid pass writes and the volume pass reads.

use bevy::{
    camera::MainPassResolutionOverride,
    prelude::*,
    render::{
        camera::ExtractedCamera,
        render_resource::{
            BindGroup, BindGroupEntries, BindGroupLayoutDescriptor, BindGroupLayoutEntries, PipelineCache,
            ShaderStages, TextureFormat, TextureSampleType, TextureView,
            binding_types::{texture_2d, texture_depth_2d},
        },
        renderer::RenderDevice,
        texture::TextureCache,
    },
};

use crate::render::{
    bind_group::KeptBindGroup,
    extract::VisibleProps,
    view::{DEPTH_FORMAT, ViewProps, coarse_size, drawn_viewport, view_texture},
};

pub(super) const SOLID_FORMAT: TextureFormat = TextureFormat::R32Uint;

/// The nearest solid prop of every pixel of the volume pass. A component of views in which props overlap.
#[derive(Component)]
pub(in crate::render) struct SolidTextures {
    /// The prop, as packed by `pack_solid` of `view.wgsl`.
    pub prop: TextureView,
    /// The depth where it is solid.
    pub depth: TextureView,
}

/// The layout of the bind group with [`SolidTextures`].
#[derive(Resource)]
pub(in crate::render) struct SolidLayout(pub BindGroupLayoutDescriptor);

impl Default for SolidLayout {
    fn default() -> Self {
        let textures = (texture_2d(TextureSampleType::Uint), texture_depth_2d());
        let entries = BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, textures);
        Self(BindGroupLayoutDescriptor::new(LABEL, &entries))
    }
}

const LABEL: &str = "plenoctree_solid";

/// The bind group with [`SolidTextures`].
#[derive(Component, Default)]
pub(in crate::render) struct SolidBindGroup(KeptBindGroup);

impl SolidBindGroup {
    pub fn get(&self) -> Option<&BindGroup> {
        self.0.get()
    }
}

pub(super) fn prepare_textures(
    mut commands: Commands,
    mut cache: ResMut<TextureCache>,
    device: Res<RenderDevice>,
    views: Query<(
        Entity,
        Option<&ExtractedCamera>,
        Option<&MainPassResolutionOverride>,
        &VisibleProps,
        &ViewProps,
        Has<SolidTextures>,
    )>,
) {
    for (entity, camera, resolution, visible, props, has_textures) in &views {
        let viewport = camera.filter(|_| props.has_overlaps()).and_then(|camera| drawn_viewport(camera, resolution));
        let Some(viewport) = viewport else {
            if has_textures {
                commands.entity(entity).remove::<SolidTextures>();
            }
            continue;
        };
        let size = coarse_size(viewport.physical_size, visible.quality.resolution);
        let mut texture = |label, format| view_texture(&mut cache, &device, label, format, size);
        commands.entity(entity).insert(SolidTextures {
            prop: texture("plenoctree_solid_prop", SOLID_FORMAT),
            depth: texture("plenoctree_solid_depth", DEPTH_FORMAT),
        });
    }
}

pub(super) fn prepare_bind_groups(
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    layout: Res<SolidLayout>,
    mut views: Query<(Option<&SolidTextures>, &mut SolidBindGroup)>,
) {
    for (textures, mut group) in &mut views {
        let Some(textures) = textures else {
            *group = default();
            continue;
        };
        let entries = BindGroupEntries::sequential((&textures.prop, &textures.depth));
        group.0.update(&device, &cache, LABEL, &layout.0, &entries);
    }
}
