//! Writes the composite to the filter's textures.

use bevy::{
    prelude::*,
    render::{
        camera::ExtractedCamera,
        diagnostic::RecordDiagnostics,
        render_resource::{
            BindGroupEntries, CachedRenderPipelineId, PipelineCache, RenderPassDescriptor, SpecializedRenderPipelines,
        },
        renderer::{RenderContext, RenderDevice, ViewQuery},
        view::ViewTarget,
    },
};

use super::{pipeline::CompositePipeline, textures::CompositeTextures};
use crate::{
    render::{
        attachment::kept,
        bind_group::{KeptBindGroup, PerMainTexture},
        fullscreen::draw,
        view::{ViewBindGroups, ViewProps, ViewTextures},
    },
    stage::PropStage,
};

/// The name of the pass's span in Bevy's render diagnostics.
pub const COMPOSITE_SPAN: &str = "plenoctree_composite";

/// The pipeline and bind groups of a view.
#[derive(Component, Default)]
pub(super) struct CompositePass {
    pipeline: Option<CachedRenderPipelineId>,
    groups: PerMainTexture<KeptBindGroup>,
}

pub(super) fn prepare_pipelines(
    cache: Res<PipelineCache>,
    pipeline: Res<CompositePipeline>,
    mut specialized: ResMut<SpecializedRenderPipelines<CompositePipeline>>,
    mut views: Query<(&ExtractedCamera, &mut ViewProps, &mut CompositePass)>,
) {
    for (camera, mut props, mut pass) in &mut views {
        // Before anything is posterized, require the pipeline that most settings need then.
        let is_filtered = props.iterations > 0 || !props.posterizes();
        let id = specialized.specialize(&cache, &pipeline, (camera.compositing_space, is_filtered));
        pass.pipeline = Some(id);
        props.pipelines.push(id);
    }
}

pub(super) fn prepare_bind_groups(
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    pipeline: Res<CompositePipeline>,
    mut views: Query<(Option<&ViewTextures>, Option<&ViewTarget>, &mut CompositePass)>,
) {
    for (textures, target, mut pass) in &mut views {
        let (Some(textures), Some(target)) = (textures, target) else {
            pass.groups = default();
            continue;
        };
        pass.groups.update(target, |group, scene| {
            let entries = BindGroupEntries::sequential((&textures.layer.color, &textures.layer.owner, scene));
            group.update(&device, &cache, pipeline.0.label, &pipeline.0.layout, &entries);
        });
    }
}

pub(super) fn composite_pass(
    InMut(stage): InMut<PropStage>,
    view: ViewQuery<(&ViewTarget, &ViewProps, &CompositeTextures, &ViewBindGroups, &CompositePass)>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (target, props, textures, groups, pass) = view.into_inner();
    let (true, Some(view), Some(group), Some(pipeline)) = (
        props.is_shown_at(*stage, &cache),
        groups.plain.get(),
        pass.groups.get(target).and_then(KeptBindGroup::get),
        pass.pipeline.and_then(|id| cache.get_render_pipeline(id)),
    ) else {
        return;
    };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), COMPOSITE_SPAN);
    {
        let attachments = [kept(&textures.even), kept(&textures.odd)];
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(COMPOSITE_SPAN),
            color_attachments: &attachments[..if props.iterations > 0 { 2 } else { 1 }],
            ..default()
        });
        draw(&mut pass, props, None, pipeline, [(view, &[]), (group, &[])]);
    }
    span.end(ctx.command_encoder());
}
