//! The textures that the solid pass writes and the volume pass reads.

use bevy::{
    camera::MainPassResolutionOverride,
    prelude::*,
    render::{
        camera::ExtractedCamera,
        render_resource::{
            BindGroupEntries, BindGroupLayoutDescriptor, BindGroupLayoutEntries, PipelineCache, ShaderStages,
            TextureFormat, TextureSampleType, TextureView,
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

pub(in crate::render) const SOLID_FORMAT: TextureFormat = TextureFormat::R32Uint;

/// The solid props of every pixel of the volume pass. A component of views in which props overlap.
#[derive(Component)]
pub(in crate::render) struct SolidTextures {
    /// The nearest one.
    pub(super) nearest: SolidRound,
    /// Where others show through the nearest one, the nearest one through which nothing shows.
    pub(super) opaque: SolidRound,
}

impl SolidTextures {
    /// Returns all textures.
    pub fn views(&self) -> impl Iterator<Item = &TextureView> {
        [&self.nearest, &self.opaque].into_iter().flat_map(|round| [&round.prop, &round.depth])
    }
}

/// The result of a round.
pub(super) struct SolidRound {
    /// The prop, as packed by `pack_solid` of `view.wgsl`.
    pub prop: TextureView,
    /// The depth where it is solid.
    pub depth: TextureView,
}

/// The layouts of the bind groups with [`SolidTextures`].
#[derive(Resource)]
pub(in crate::render) struct SolidLayouts {
    /// For the second round: the prop that the first one found.
    pub first: BindGroupLayoutDescriptor,
    /// For the volume pass: the results of both rounds.
    pub both: BindGroupLayoutDescriptor,
}

impl Default for SolidLayouts {
    fn default() -> Self {
        let (prop, depth) = (|| texture_2d(TextureSampleType::Uint), texture_depth_2d);
        let both = BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, (prop(), depth(), prop(), depth()));
        let first = BindGroupLayoutEntries::single(ShaderStages::FRAGMENT, prop());
        Self {
            first: BindGroupLayoutDescriptor::new(LABEL, &first),
            both: BindGroupLayoutDescriptor::new(LABEL, &both),
        }
    }
}

const LABEL: &str = "plenoctree_solid";

/// The bind groups with [`SolidTextures`].
#[derive(Component, Default)]
pub(in crate::render) struct SolidBindGroups {
    pub(super) first: KeptBindGroup,
    pub both: KeptBindGroup,
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
        let mut round = || SolidRound {
            prop: texture("plenoctree_solid_prop", SOLID_FORMAT),
            depth: texture("plenoctree_solid_depth", DEPTH_FORMAT),
        };
        let (nearest, opaque) = (round(), round());
        commands.entity(entity).insert(SolidTextures { nearest, opaque });
    }
}

pub(super) fn prepare_bind_groups(
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    layouts: Res<SolidLayouts>,
    mut views: Query<(Option<&SolidTextures>, &mut SolidBindGroups)>,
) {
    for (textures, mut groups) in &mut views {
        let Some(SolidTextures { nearest, opaque }) = textures else {
            *groups = default();
            continue;
        };
        let entries = BindGroupEntries::single(&nearest.prop);
        groups.first.update(&device, &cache, LABEL, &layouts.first, &entries);
        let entries = BindGroupEntries::sequential((&nearest.prop, &nearest.depth, &opaque.prop, &opaque.depth));
        groups.both.update(&device, &cache, LABEL, &layouts.both, &entries);
    }
}
