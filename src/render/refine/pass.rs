//! Runs the interpolate pass and the gather pass.

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

use super::{
    batches::Batches,
    gather::GatherPipeline,
    interpolate::{InterpolateKey, InterpolatePipeline},
};
use crate::render::{
    attachment::{self, cleared, depth},
    bind_group::KeptBindGroup,
    fullscreen::draw,
    kept::KeptView,
    view::{Layer, ViewBindGroups, ViewProps, ViewTextures},
    volume::VolumePipelines,
};

/// The names of the passes' spans in Bevy's render diagnostics.
pub const INTERPOLATE_SPAN: &str = "plenoctree_interpolate";
pub const GATHER_SPAN: &str = "plenoctree_gather";

/// The pipelines and bind groups of a view that does not cast a ray for every pixel.
#[derive(Component, Default)]
pub(in crate::render) struct RefinePass {
    interpolate: Option<CachedRenderPipelineId>,
    gather: Option<CachedRenderPipelineId>,
    grid: KeptBindGroup,
    batches: KeptBindGroup,
}

impl RefinePass {
    /// Returns whether all pipelines that the view needs have been created.
    pub fn is_ready(&self, cache: &PipelineCache) -> bool {
        [self.interpolate, self.gather].into_iter().flatten().all(|id| cache.get_render_pipeline(id).is_some())
    }
}

pub(super) fn prepare_pipelines(
    cache: Res<PipelineCache>,
    interpolate: Res<InterpolatePipeline>,
    mut interpolates: ResMut<SpecializedRenderPipelines<InterpolatePipeline>>,
    gather: Res<GatherPipeline>,
    mut gathers: ResMut<SpecializedRenderPipelines<GatherPipeline>>,
    mut views: Query<(Option<&ViewTextures>, &Msaa, &mut RefinePass)>,
) {
    for (textures, msaa, mut pass) in &mut views {
        let Some(textures) = textures.filter(|textures| textures.sparse.is_some()) else {
            *pass = default();
            continue;
        };
        let motion = textures.layer.motion.is_some();
        let key = InterpolateKey { multisampled: msaa.samples() > 1, motion };
        pass.interpolate = Some(interpolates.specialize(&cache, &interpolate, key));
        pass.gather = Some(gathers.specialize(&cache, &gather, motion));
    }
}

pub(super) fn prepare_bind_groups(
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    interpolate: Res<InterpolatePipeline>,
    gather: Res<GatherPipeline>,
    mut views: Query<(Option<&ViewTextures>, &Batches, &mut RefinePass)>,
) {
    for (textures, batches, mut pass) in &mut views {
        let sparse = textures.and_then(|textures| textures.sparse.as_ref());
        let (Some(sparse), Some([counts, pixels])) = (sparse, batches.bindings()) else {
            (pass.grid, pass.batches) = default();
            continue;
        };
        let Layer { color, owner, depth, .. } = &sparse.grid;
        let mut entries = BindGroupEntries::sequential((color, owner, depth, counts, pixels)).to_vec();
        entries.extend(motion_entry(&sparse.grid, 5));
        let shared = interpolate.shared(sparse.grid.motion.is_some());
        pass.grid.update(&device, &cache, shared.label, &shared.layout, &entries);

        let Layer { color, owner, depth, .. } = &sparse.batches;
        let mut entries = BindGroupEntries::sequential((&sparse.indices, color, owner, depth)).to_vec();
        entries.extend(motion_entry(&sparse.batches, 4));
        let shared = gather.shared(sparse.batches.motion.is_some());
        pass.batches.update(&device, &cache, shared.label, &shared.layout, &entries);
    }
}

fn motion_entry(layer: &Layer, binding: u32) -> Option<BindGroupEntry<'_>> {
    layer.motion.as_ref().map(|motion| BindGroupEntry { binding, resource: motion.into_binding() })
}

pub(super) fn interpolate_pass(
    view: ViewQuery<(&ViewTextures, &ViewProps, &ViewBindGroups, &KeptView, &Batches, &RefinePass)>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (textures, props, groups, kept, batches, refine) = view.into_inner();
    let (Some(view), Some(group), Some(pipeline), Some(sparse), Some(counts)) = (
        groups.with_depth.get(),
        refine.grid.get(),
        refine.interpolate.and_then(|id| cache.get_render_pipeline(id)),
        &textures.sparse,
        batches.counts(),
    ) else {
        return;
    };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), INTERPOLATE_SPAN);
    ctx.command_encoder().clear_buffer(counts, 0, None);
    {
        let (layer, clears) = (&textures.layer, kept.layer.is_drawn());
        let mut attachments = layer.attachments(clears);
        attachments.insert(2, if clears { cleared(&sparse.indices) } else { attachment::kept(&sparse.indices) });
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(INTERPOLATE_SPAN),
            color_attachments: &attachments,
            depth_stencil_attachment: Some(depth(&layer.depth, clears)),
            ..default()
        });
        draw(&mut pass, props, None, pipeline, [(view, &[]), (group, &[])]);
    }
    span.end(ctx.command_encoder());
}

pub(super) fn gather_pass(
    view: ViewQuery<(&ViewTextures, &ViewProps, &ViewBindGroups, &VolumePipelines, &RefinePass)>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (textures, props, groups, volume, refine) = view.into_inner();
    // Until all rays can be marched, pixels show what was interpolated.
    if !volume.are_ready(&cache) {
        return;
    }
    let (Some(view), Some(group), Some(pipeline)) =
        (groups.plain.get(), refine.batches.get(), refine.gather.and_then(|id| cache.get_render_pipeline(id)))
    else {
        return;
    };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), GATHER_SPAN);
    {
        let layer = &textures.layer;
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(GATHER_SPAN),
            color_attachments: &layer.attachments(false),
            depth_stencil_attachment: Some(depth(&layer.depth, false)),
            ..default()
        });
        draw(&mut pass, props, None, pipeline, [(view, &[]), (group, &[])]);
    }
    span.end(ctx.command_encoder());
}
