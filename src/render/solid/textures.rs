//! The textures that the solid pass writes and the volume pass reads.

use bevy::{
    prelude::*,
    render::{
        render_resource::{
            BindGroupEntries, BindGroupLayoutDescriptor, BindGroupLayoutEntries, PipelineCache, ShaderStages,
            TextureFormat, TextureSampleType, TextureView,
            binding_types::{texture_2d, texture_depth_2d},
        },
        renderer::RenderDevice,
    },
};

use crate::render::{
    bind_group::KeptBindGroup,
    extract::VisibleProps,
    refine::{RaysOf, batches_size},
    view::{DEPTH_FORMAT, ViewMemory, ViewProps, grid_size, spacing},
};

pub(in crate::render) const SOLID_FORMAT: TextureFormat = TextureFormat::R32Uint;

/// The solid props of every ray of the volume pass. A component of views in which props overlap.
#[derive(Component)]
pub(in crate::render) struct SolidTextures {
    grid: SolidRounds,
    /// In views with batches.
    pub(super) batches: Option<SolidRounds>,
}

impl SolidTextures {
    /// Returns the textures for some rays.
    pub(super) fn rounds(&self, rays: RaysOf) -> Option<&SolidRounds> {
        match rays {
            RaysOf::Grid => Some(&self.grid),
            RaysOf::Batches => self.batches.as_ref(),
        }
    }

    /// Returns all textures.
    pub fn views(&self) -> impl Iterator<Item = &TextureView> {
        let rounds = [Some(&self.grid), self.batches.as_ref()].into_iter().flatten();
        rounds.flat_map(|rounds| [&rounds.nearest, &rounds.opaque]).flat_map(|round| [&round.prop, &round.depth])
    }
}

/// The solid props of rays.
pub(super) struct SolidRounds {
    /// The nearest one.
    pub nearest: SolidRound,
    /// Where others show through the nearest one, the nearest one through which nothing shows.
    pub opaque: SolidRound,
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
    grid: RoundsBindGroups,
    batches: RoundsBindGroups,
}

#[derive(Default)]
pub(in crate::render) struct RoundsBindGroups {
    pub(super) first: KeptBindGroup,
    pub both: KeptBindGroup,
}

impl SolidBindGroups {
    /// Returns the bind groups for some rays.
    pub fn of(&self, rays: RaysOf) -> &RoundsBindGroups {
        match rays {
            RaysOf::Grid => &self.grid,
            RaysOf::Batches => &self.batches,
        }
    }
}

pub(super) fn prepare_textures(
    mut commands: Commands,
    device: Res<RenderDevice>,
    mut views: Query<(Entity, &VisibleProps, &ViewProps, &mut ViewMemory)>,
) {
    for (entity, visible, props, mut memory) in &mut views {
        let mut rounds = |size| {
            let mut round = || {
                Some(SolidRound {
                    prop: memory.view(&device, "plenoctree_solid_prop", SOLID_FORMAT, size)?,
                    depth: memory.view(&device, "plenoctree_solid_depth", DEPTH_FORMAT, size)?,
                })
            };
            Some(SolidRounds { nearest: round()?, opaque: round()? })
        };
        let textures = props.viewport_size().filter(|_| props.has_overlaps()).and_then(|size| {
            let spacing = spacing(&visible.quality);
            let grid = rounds(grid_size(size, spacing))?;
            let batches = if spacing > 1 { Some(rounds(batches_size(size, spacing))?) } else { None };
            Some(SolidTextures { grid, batches })
        });
        match textures {
            Some(textures) => commands.entity(entity).insert(textures),
            None => commands.entity(entity).remove::<SolidTextures>(),
        };
    }
}

pub(super) fn prepare_bind_groups(
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    layouts: Res<SolidLayouts>,
    mut views: Query<(Option<&SolidTextures>, &mut SolidBindGroups)>,
) {
    for (textures, mut groups) in &mut views {
        let SolidBindGroups { grid, batches } = &mut *groups;
        for (groups, rays) in [(grid, RaysOf::Grid), (batches, RaysOf::Batches)] {
            let Some(SolidRounds { nearest, opaque }) = textures.and_then(|textures| textures.rounds(rays)) else {
                *groups = default();
                continue;
            };
            let entries = BindGroupEntries::single(&nearest.prop);
            groups.first.update(&device, &cache, LABEL, &layouts.first, &entries);
            let entries = BindGroupEntries::sequential((&nearest.prop, &nearest.depth, &opaque.prop, &opaque.depth));
            groups.both.update(&device, &cache, LABEL, &layouts.both, &entries);
        }
    }
}
