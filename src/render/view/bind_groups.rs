//! Bind group 0 of a view's passes.

use bevy::{
    prelude::*,
    render::{
        render_resource::{BindGroupEntries, PipelineCache},
        renderer::RenderDevice,
        view::ViewDepthTexture,
    },
};

use super::{layout::ViewLayouts, props::ViewProps};
use crate::render::{bind_group::KeptBindGroup, kept::KeptView};

/// Bind group 0 of a view's passes, in two variants.
#[derive(Component, Default)]
pub(in crate::render) struct ViewBindGroups {
    /// Includes the depth of the scene.
    pub with_depth: KeptBindGroup,
    /// Does not include the depth of the scene.
    pub plain: KeptBindGroup,
}

pub(super) fn prepare(
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    layouts: Res<ViewLayouts>,
    mut views: Query<(&ViewProps, &KeptView, Option<(&ViewDepthTexture, &Msaa)>, &mut ViewBindGroups)>,
) {
    for (props, kept, target, mut groups) in &mut views {
        let (Some((view, list, colors)), Some(stale), Some((depth, msaa))) = (props.bindings(), kept.stale(), target)
        else {
            *groups = default();
            continue;
        };
        let layout = &layouts.with_depth[usize::from(msaa.samples() > 1)];
        let entries =
            BindGroupEntries::sequential((view.clone(), list.clone(), colors.clone(), stale.clone(), depth.view()));
        groups.with_depth.update(&device, &cache, "plenoctree_view_with_depth", layout, &entries);
        let entries = BindGroupEntries::sequential((view, list, colors, stale));
        groups.plain.update(&device, &cache, "plenoctree_view", &layouts.plain, &entries);
    }
}
