//! Runs the filter, alternating between two textures.

use std::num::NonZero;

use bevy::{
    prelude::*,
    render::{
        diagnostic::RecordDiagnostics,
        render_resource::{BindGroupEntries, BufferBinding, PipelineCache, RenderPassDescriptor},
        renderer::{RenderContext, RenderDevice, ViewQuery},
    },
};

use super::pipeline::{FilterPipelines, ITERATION_STRIDE};
use crate::{
    render::{
        attachment::{kept, tested},
        bind_group::KeptBindGroup,
        composite::CompositeTextures,
        fullscreen::draw,
        view::{ViewBindGroups, ViewProps, ViewTextures},
    },
    stage::PropStage,
};

/// The name of the pass's span in Bevy's render diagnostics.
pub const FILTER_SPAN: &str = "plenoctree_filter";

/// The bind groups of the two directions.
#[derive(Component, Default)]
pub(super) struct FilterBindGroups {
    horizontal: KeptBindGroup,
    vertical: KeptBindGroup,
}

pub(super) fn require_pipelines(filter: Res<FilterPipelines>, mut views: Query<&mut ViewProps>) {
    for mut props in &mut views {
        props.pipelines.extend([filter.horizontal, filter.vertical]);
    }
}

pub(super) fn prepare_bind_groups(
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    filter: Res<FilterPipelines>,
    mut views: Query<(Option<&CompositeTextures>, &mut FilterBindGroups)>,
) {
    for (textures, mut groups) in &mut views {
        let Some(textures) = textures else {
            *groups = default();
            continue;
        };
        let FilterBindGroups { horizontal, vertical } = &mut *groups;
        for (group, source) in [(horizontal, &textures.even), (vertical, &textures.odd)] {
            let iteration = BufferBinding { buffer: &filter.iterations, offset: 0, size: NonZero::new(16) };
            let entries = BindGroupEntries::sequential((source, iteration));
            group.update(&device, &cache, filter.label, &filter.layout, &entries);
        }
    }
}

pub(super) fn filter_pass(
    InMut(stage): InMut<PropStage>,
    view: ViewQuery<(&ViewProps, &ViewTextures, &CompositeTextures, &ViewBindGroups, &FilterBindGroups)>,
    cache: Res<PipelineCache>,
    filter: Res<FilterPipelines>,
    mut ctx: RenderContext,
) {
    let (props, textures, composite, groups, filters) = view.into_inner();
    if props.iterations == 0 || !props.is_shown_at(*stage, &cache) {
        return;
    }
    let (Some(view), Some(from_even), Some(from_odd), Some(horizontal), Some(vertical)) = (
        groups.plain.get(),
        filters.horizontal.get(),
        filters.vertical.get(),
        cache.get_render_pipeline(filter.horizontal),
        cache.get_render_pipeline(filter.vertical),
    ) else {
        return;
    };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), FILTER_SPAN);
    for iteration in 0..props.iterations {
        let offset = [iteration * ITERATION_STRIDE];
        for (target, pipeline, group) in
            [(&composite.odd, horizontal, from_even), (&composite.even, vertical, from_odd)]
        {
            let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
                label: Some(FILTER_SPAN),
                color_attachments: &[kept(target)],
                depth_stencil_attachment: Some(tested(&textures.layer.depth)),
                ..default()
            });
            draw(&mut pass, props, None, pipeline, [(view, &[]), (group, &offset)]);
        }
    }
    span.end(ctx.command_encoder());
}
