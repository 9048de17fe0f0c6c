//! Writes to the scene's depth texture.

use bevy::{
    camera::MainPassResolutionOverride,
    prelude::*,
    render::{
        camera::ExtractedCamera,
        diagnostic::RecordDiagnostics,
        render_resource::{
            BindGroupEntries, CachedRenderPipelineId, PipelineCache, RenderPassDescriptor, SpecializedRenderPipelines,
            StoreOp,
        },
        renderer::{RenderContext, RenderDevice, ViewQuery},
        view::ViewDepthTexture,
    },
};

use super::pipeline::DepthPipeline;
use crate::{
    render::{
        bind_group::KeptBindGroup,
        fullscreen::draw,
        view::{ViewBindGroups, ViewProps, ViewTextures, drawn_viewport},
    },
    stage::PropStage,
};

/// The name of the pass's span in Bevy's render diagnostics.
pub const DEPTH_SPAN: &str = "plenoctree_depth";

/// The pipeline and bind group of a view.
#[derive(Component, Default)]
pub(super) struct DepthPass {
    pipeline: Option<CachedRenderPipelineId>,
    group: KeptBindGroup,
}

pub(super) fn prepare_pipelines(
    cache: Res<PipelineCache>,
    pipeline: Res<DepthPipeline>,
    mut specialized: ResMut<SpecializedRenderPipelines<DepthPipeline>>,
    mut views: Query<(&Msaa, &mut ViewProps, &mut DepthPass)>,
) {
    for (msaa, mut props, mut pass) in &mut views {
        let id = specialized.specialize(&cache, &pipeline, msaa.samples());
        pass.pipeline = Some(id);
        props.pipelines.push(id);
    }
}

pub(super) fn prepare_bind_groups(
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    pipeline: Res<DepthPipeline>,
    mut views: Query<(Option<&ViewTextures>, &mut DepthPass)>,
) {
    for (textures, mut pass) in &mut views {
        let Some(textures) = textures else {
            *pass = default();
            continue;
        };
        let entries = BindGroupEntries::single(&textures.layer.depth);
        pass.group.update(&device, &cache, pipeline.0.label, &pipeline.0.layout, &entries);
    }
}

pub(super) fn depth_pass(
    InMut(stage): InMut<PropStage>,
    view: ViewQuery<(
        &ExtractedCamera,
        Option<&MainPassResolutionOverride>,
        &ViewDepthTexture,
        &ViewProps,
        &ViewBindGroups,
        &DepthPass,
    )>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (camera, resolution, depth, props, groups, pass) = view.into_inner();
    let (true, Some(view), Some(group), Some(pipeline)) = (
        props.is_shown_at(*stage, &cache),
        groups.plain.get(),
        pass.group.get(),
        pass.pipeline.and_then(|id| cache.get_render_pipeline(id)),
    ) else {
        return;
    };
    let viewport = drawn_viewport(camera, resolution);
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), DEPTH_SPAN);
    {
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(DEPTH_SPAN),
            depth_stencil_attachment: Some(depth.get_attachment(StoreOp::Store)),
            ..default()
        });
        draw(&mut pass, props, viewport.as_ref(), pipeline, [(view, &[]), (group, &[])]);
    }
    span.end(ctx.command_encoder());
}
