//! Runs the check pass and the fill pass.

use bevy::{
    prelude::*,
    render::{
        diagnostic::RecordDiagnostics,
        render_resource::{
            BindGroupEntries, BindGroupEntry, CachedRenderPipelineId, IntoBinding, PipelineCache, RenderPassDescriptor,
            SpecializedRenderPipelines,
        },
        renderer::{RenderContext, RenderDevice, ViewQuery},
    },
};

use super::{batches::Batches, check::CheckPipeline, fill::FillPipeline};
use crate::render::{
    attachment::{cleared, depth, kept},
    bind_group::KeptBindGroup,
    fullscreen::{draw, draw_part},
    kept::KeptView,
    view::{ViewBindGroups, ViewProps, ViewTextures},
    volume::VolumePipelines,
};

/// The names of the passes' spans in Bevy's render diagnostics.
pub const CHECK_SPAN: &str = "plenoctree_check";
pub const FILL_SPAN: &str = "plenoctree_fill";

/// The pipelines and bind groups of a view that does not cast a ray for every pixel.
#[derive(Component, Default)]
pub(in crate::render) struct RefinePass {
    check: Option<CachedRenderPipelineId>,
    fill: Option<CachedRenderPipelineId>,
    checked: KeptBindGroup,
    filled: KeptBindGroup,
}

impl RefinePass {
    /// Returns whether all pipelines that the view needs have been created.
    pub fn is_ready(&self, cache: &PipelineCache) -> bool {
        [self.check, self.fill].into_iter().flatten().all(|id| cache.get_render_pipeline(id).is_some())
    }
}

pub(super) fn prepare_pipelines(
    cache: Res<PipelineCache>,
    check: Res<CheckPipeline>,
    mut checks: ResMut<SpecializedRenderPipelines<CheckPipeline>>,
    fill: Res<FillPipeline>,
    mut fills: ResMut<SpecializedRenderPipelines<FillPipeline>>,
    mut views: Query<(Option<&ViewTextures>, &Msaa, &mut RefinePass)>,
) {
    for (textures, msaa, mut pass) in &mut views {
        let Some(textures) = textures.filter(|textures| textures.sparse.is_some()) else {
            *pass = default();
            continue;
        };
        pass.check = Some(checks.specialize(&cache, &check, msaa.samples() > 1));
        pass.fill = Some(fills.specialize(&cache, &fill, textures.layer.motion.is_some()));
    }
}

pub(super) fn prepare_bind_groups(
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    check: Res<CheckPipeline>,
    fill: Res<FillPipeline>,
    mut views: Query<(Option<&ViewTextures>, &Batches, &mut RefinePass)>,
) {
    for (textures, batches, mut pass) in &mut views {
        let sparse = textures.and_then(|textures| textures.sparse.as_ref());
        let (Some(sparse), Some([counts, gaps])) = (sparse, batches.bindings()) else {
            (pass.checked, pass.filled) = default();
            continue;
        };
        let [grid, batches] = [&sparse.grid, &sparse.batches];
        let entries = BindGroupEntries::sequential((&grid.color, &grid.owner, &grid.depth, counts, gaps));
        pass.checked.update(&device, &cache, check.shared.label, &check.shared.layout, &entries);

        let mut entries = BindGroupEntries::sequential((
            &sparse.gaps,
            &grid.color,
            &grid.owner,
            &grid.depth,
            &batches.color,
            &batches.owner,
            &batches.depth,
        ))
        .to_vec();
        let motion = [grid, batches].into_iter().filter_map(|layer| layer.motion.as_ref());
        entries.extend(
            (7..).zip(motion).map(|(binding, motion)| BindGroupEntry { binding, resource: motion.into_binding() }),
        );
        let shared = fill.shared(grid.motion.is_some());
        pass.filled.update(&device, &cache, shared.label, &shared.layout, &entries);
    }
}

pub(super) fn check_pass(
    view: ViewQuery<(&ViewTextures, &ViewProps, &ViewBindGroups, &KeptView, &Batches, &VolumePipelines, &RefinePass)>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (textures, props, groups, keep, batches, volume, refine) = view.into_inner();
    let (Some(view), Some(group), Some(sparse), Some(counts)) =
        (groups.with_depth.get(), refine.checked.get(), &textures.sparse, batches.counts())
    else {
        return;
    };
    // Until all rays can be marched, all gaps are interpolated.
    let pipeline = refine.check.and_then(|id| cache.get_render_pipeline(id)).filter(|_| volume.are_ready(&cache));
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), CHECK_SPAN);
    ctx.command_encoder().clear_buffer(counts, 0, None);
    {
        let gaps = if keep.layer.is_drawn() { cleared(&sparse.gaps) } else { kept(&sparse.gaps) };
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(CHECK_SPAN),
            color_attachments: &[gaps],
            ..default()
        });
        if let Some(pipeline) = pipeline {
            let spacing = props.view.get().spacing;
            let (low, high) = (props.rect.min / spacing, (props.rect.max + spacing - 1) / spacing);
            draw_part(&mut pass, URect { min: low, max: high }, pipeline, [(view, &[]), (group, &[])]);
        }
    }
    span.end(ctx.command_encoder());
}

pub(super) fn fill_pass(
    view: ViewQuery<(&ViewTextures, &ViewProps, &ViewBindGroups, &KeptView, &RefinePass)>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (textures, props, groups, kept, refine) = view.into_inner();
    let (Some(view), Some(group), Some(pipeline)) =
        (groups.plain.get(), refine.filled.get(), refine.fill.and_then(|id| cache.get_render_pipeline(id)))
    else {
        return;
    };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), FILL_SPAN);
    {
        let (layer, clears) = (&textures.layer, kept.layer.is_drawn());
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(FILL_SPAN),
            color_attachments: &layer.attachments(clears),
            depth_stencil_attachment: Some(depth(&layer.depth, clears)),
            ..default()
        });
        draw(&mut pass, props, None, pipeline, [(view, &[]), (group, &[])]);
    }
    span.end(ctx.command_encoder());
}
