//! Draws transparent objects, and blends them over props.

use bevy::{
    camera::MainPassResolutionOverride,
    core_pipeline::core_3d::Transparent3d,
    prelude::*,
    render::{
        camera::ExtractedCamera,
        diagnostic::RecordDiagnostics,
        render_phase::ViewSortedRenderPhases,
        render_resource::{
            BindGroupEntries, CachedRenderPipelineId, PipelineCache, RenderPassDescriptor, SpecializedRenderPipelines,
            StoreOp,
        },
        renderer::{RenderContext, RenderDevice, ViewQuery},
        view::{ExtractedView, ViewDepthTexture, ViewTarget},
    },
};

use super::{pipeline::TransparentPipeline, textures::TransparentTexture};
use crate::{
    render::{
        bind_group::KeptBindGroup,
        fullscreen::draw,
        target::target_attachment,
        view::{ViewBindGroups, ViewProps, ViewTextures, drawn_viewport},
    },
    stage::PropStage,
};

/// The name of the pass's span in Bevy's render diagnostics.
pub const TRANSPARENT_SPAN: &str = "plenoctree_transparent";

/// The pipeline and bind group of a view.
#[derive(Component, Default)]
pub(super) struct TransparentPass {
    pipeline: Option<CachedRenderPipelineId>,
    group: KeptBindGroup,
}

pub(super) fn prepare_pipelines(
    cache: Res<PipelineCache>,
    pipeline: Res<TransparentPipeline>,
    mut specialized: ResMut<SpecializedRenderPipelines<TransparentPipeline>>,
    mut views: Query<(&ExtractedView, &mut TransparentPass), With<TransparentTexture>>,
) {
    for (view, mut pass) in &mut views {
        pass.pipeline = Some(specialized.specialize(&cache, &pipeline, view.target_format));
    }
}

pub(super) fn prepare_bind_groups(
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    pipeline: Res<TransparentPipeline>,
    mut views: Query<(Option<(&ViewTextures, &TransparentTexture)>, &mut TransparentPass)>,
) {
    for (textures, mut pass) in &mut views {
        let Some((textures, TransparentTexture(objects))) = textures else {
            *pass = default();
            continue;
        };
        let entries = BindGroupEntries::sequential((&textures.layer.depth, &objects.texture.default_view));
        pass.group.update(&device, &cache, pipeline.0.label, &pipeline.0.layout, &entries);
    }
}

pub(super) fn transparent_pass(
    world: &World,
    view: ViewQuery<(
        &ExtractedView,
        &ExtractedCamera,
        Option<&MainPassResolutionOverride>,
        &ViewTarget,
        &ViewDepthTexture,
        &ViewProps,
        &ViewBindGroups,
        &TransparentPass,
        &TransparentTexture,
    )>,
    phases: Res<ViewSortedRenderPhases<Transparent3d>>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let entity = view.entity();
    let (extracted, camera, resolution, target, depth, props, groups, pass, objects) = view.into_inner();
    let (true, Some(view), Some(group), Some(pipeline), Some(phase), Some(viewport)) = (
        props.is_shown_at(PropStage::Display, &cache),
        groups.plain.get(),
        pass.group.get(),
        pass.pipeline.and_then(|id| cache.get_render_pipeline(id)),
        phases.get(&extracted.retained_view_entity),
        drawn_viewport(camera, resolution),
    ) else {
        return;
    };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), TRANSPARENT_SPAN);
    {
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(TRANSPARENT_SPAN),
            color_attachments: &[Some(objects.0.get_attachment())],
            // It already has the depth of the props.
            depth_stencil_attachment: Some(depth.get_attachment(StoreOp::Store)),
            ..default()
        });
        pass.set_camera_viewport(&viewport);
        if let Err(error) = phase.render(&mut pass, world, entity) {
            error!("failed to draw transparent objects over props: {error}");
        }
    }
    {
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(TRANSPARENT_SPAN),
            color_attachments: &[Some(target_attachment(target, props.stage))],
            ..default()
        });
        draw(&mut pass, props, Some(&viewport), pipeline, [(view, &[]), (group, &[])]);
    }
    span.end(ctx.command_encoder());
}
