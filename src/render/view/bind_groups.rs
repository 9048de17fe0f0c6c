//! Bind group 0 of a view's passes.

use bevy::{
    prelude::*,
    render::{
        render_resource::{BindGroup, BindGroupEntries, BindGroupEntry, PipelineCache},
        renderer::RenderDevice,
        view::ViewDepthTexture,
    },
};

use super::{layout::ViewLayouts, props::ViewProps};
use crate::render::{
    bind_group::KeptBindGroup,
    kept::KeptView,
    refine::{Batches, RaysOf},
};

/// Bind group 0 of a view's passes, in three variants.
#[derive(Component, Default)]
pub(in crate::render) struct ViewBindGroups {
    /// Includes the depth of the scene.
    pub with_depth: KeptBindGroup,
    /// Includes the depth of the scene and the batches, in views that have them.
    pub with_batches: KeptBindGroup,
    /// Does not include the depth of the scene.
    pub plain: KeptBindGroup,
}

impl ViewBindGroups {
    /// Returns the bind group of passes that march some rays.
    pub fn marching(&self, rays: RaysOf) -> Option<&BindGroup> {
        match rays {
            RaysOf::Grid => self.with_depth.get(),
            RaysOf::Batches => self.with_batches.get(),
        }
    }
}

pub(super) fn prepare(
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    layouts: Res<ViewLayouts>,
    mut views: Query<(&ViewProps, &KeptView, &Batches, Option<(&ViewDepthTexture, &Msaa)>, &mut ViewBindGroups)>,
) {
    for (props, kept, batches, target, mut groups) in &mut views {
        let (Some((view, list, colors)), Some(stale), Some((depth, msaa))) = (props.bindings(), kept.stale(), target)
        else {
            *groups = default();
            continue;
        };
        let layout = &layouts.with_depth[usize::from(msaa.samples() > 1)];
        let entries =
            BindGroupEntries::sequential((view.clone(), list.clone(), colors.clone(), stale.clone(), depth.view()));
        groups.with_depth.update(&device, &cache, "plenoctree_view_with_depth", layout, &entries);
        if let Some([counts, pixels]) = batches.bindings() {
            let layout = &layouts.with_batches[usize::from(msaa.samples() > 1)];
            let entries: Vec<_> = entries
                .iter()
                .cloned()
                .chain([(5, counts), (6, pixels)].map(|(binding, resource)| BindGroupEntry { binding, resource }))
                .collect();
            groups.with_batches.update(&device, &cache, "plenoctree_view_with_batches", layout, &entries);
        } else {
            groups.with_batches = default();
        }
        let entries = BindGroupEntries::sequential((view, list, colors, stale));
        groups.plain.update(&device, &cache, "plenoctree_view", &layouts.plain, &entries);
    }
}
