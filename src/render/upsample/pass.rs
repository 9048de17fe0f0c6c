//! Interpolates the coarse layer.

use bevy::{
    prelude::*,
    render::{
        diagnostic::RecordDiagnostics,
        render_resource::{BindGroupEntries, BindGroupEntry, IntoBinding, PipelineCache, RenderPassDescriptor},
        renderer::{RenderContext, RenderDevice, ViewQuery},
    },
};

use super::pipeline::UpsamplePipeline;
use crate::render::{
    attachment::depth,
    bind_group::KeptBindGroup,
    fullscreen::draw,
    kept::KeptView,
    view::{ViewBindGroups, ViewProps, ViewTextures},
};

/// The name of the pass's span in Bevy's render diagnostics.
pub const UPSAMPLE_SPAN: &str = "plenoctree_upsample";

/// The bind group of the coarse layer, in views that have one.
#[derive(Component, Default)]
pub(super) struct UpsampleBindGroup(KeptBindGroup);

pub(super) fn prepare_bind_groups(
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    pipeline: Res<UpsamplePipeline>,
    mut views: Query<(Option<&ViewTextures>, &mut UpsampleBindGroup)>,
) {
    for (textures, mut group) in &mut views {
        let Some(coarse) = textures.and_then(|textures| textures.coarse.as_ref()) else {
            *group = default();
            continue;
        };
        let shared = pipeline.shared(coarse.motion.is_some());
        let mut entries = BindGroupEntries::sequential((&coarse.color, &coarse.owner, &coarse.depth)).to_vec();
        entries.extend(
            coarse.motion.as_ref().map(|motion| BindGroupEntry { binding: 3, resource: motion.into_binding() }),
        );
        group.0.update(&device, &cache, shared.label, &shared.layout, &entries);
    }
}

pub(super) fn upsample_pass(
    view: ViewQuery<(&ViewTextures, &ViewProps, &ViewBindGroups, &KeptView, &UpsampleBindGroup, &Msaa)>,
    cache: Res<PipelineCache>,
    upsample: Res<UpsamplePipeline>,
    mut ctx: RenderContext,
) {
    let (textures, props, groups, kept, group, msaa) = view.into_inner();
    let (Some(view), Some(group), Some(pipeline)) = (
        groups.with_depth.get(),
        group.0.get(),
        cache.get_render_pipeline(upsample.id(msaa, textures.layer.motion.is_some())),
    ) else {
        return;
    };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), UPSAMPLE_SPAN);
    {
        let (layer, clears) = (&textures.layer, kept.layer.is_drawn());
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(UPSAMPLE_SPAN),
            color_attachments: &layer.attachments(clears),
            depth_stencil_attachment: Some(depth(&layer.depth, clears)),
            ..default()
        });
        draw(&mut pass, props, None, pipeline, [(view, &[]), (group, &[])]);
    }
    span.end(ctx.command_encoder());
}
