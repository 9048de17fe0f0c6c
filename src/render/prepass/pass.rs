//! Writes to the textures of Bevy's prepass.

use bevy::{
    camera::MainPassResolutionOverride,
    core_pipeline::prepass::{DepthPrepass, ViewPrepassTextures},
    prelude::*,
    render::{
        camera::ExtractedCamera,
        diagnostic::RecordDiagnostics,
        render_resource::{
            BindGroupEntries, CachedRenderPipelineId, LoadOp, Operations, PipelineCache,
            RenderPassDepthStencilAttachment, RenderPassDescriptor, SpecializedRenderPipelines, StoreOp,
        },
        renderer::{RenderContext, RenderDevice, ViewQuery},
    },
};

use super::pipeline::{PrepassKey, PrepassPipeline};
use crate::{
    render::{
        bind_group::KeptBindGroup,
        extract::VisibleProps,
        fullscreen::draw,
        view::{ViewBindGroups, ViewProps, ViewTextures, drawn_viewport},
    },
    stage::PropStage,
};

/// The name of the pass's span in Bevy's render diagnostics.
pub const PREPASS_SPAN: &str = "plenoctree_prepass";

/// The pipeline and bind group of a view that has a prepass.
#[derive(Component, Default)]
pub(super) struct PrepassPass {
    pipeline: Option<CachedRenderPipelineId>,
    group: KeptBindGroup,
}

pub(super) fn prepare_pipelines(
    cache: Res<PipelineCache>,
    pipeline: Res<PrepassPipeline>,
    mut specialized: ResMut<SpecializedRenderPipelines<PrepassPipeline>>,
    mut views: Query<(&VisibleProps, &mut ViewProps, &Msaa, Has<DepthPrepass>, &mut PrepassPass)>,
) {
    for (visible, mut props, msaa, depth, mut pass) in &mut views {
        let key = PrepassKey { motion: visible.has_motion, depth, samples: msaa.samples() };
        let writes = props.stage == PropStage::Scene && (key.motion || key.depth);
        pass.pipeline = writes.then(|| specialized.specialize(&cache, &pipeline, key));
        props.pipelines.extend(pass.pipeline);
    }
}

pub(super) fn prepare_bind_groups(
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    pipeline: Res<PrepassPipeline>,
    mut views: Query<(Option<(&ViewTextures, &ViewPrepassTextures)>, &mut PrepassPass)>,
) {
    for (textures, mut pass) in &mut views {
        let Some((textures, prepass)) = textures else {
            *pass = default();
            continue;
        };
        let layer = &textures.layer;
        match layer.motion.as_ref().filter(|_| prepass.motion_vectors.is_some()) {
            Some(motion) => {
                let shared = pipeline.pass(true);
                let entries = BindGroupEntries::sequential((&layer.depth, motion));
                pass.group.update(&device, &cache, shared.label, &shared.layout, &entries);
            }
            None => {
                let shared = pipeline.pass(false);
                let entries = BindGroupEntries::single(&layer.depth);
                pass.group.update(&device, &cache, shared.label, &shared.layout, &entries);
            }
        }
    }
}

pub(super) fn prepass_pass(
    view: ViewQuery<(
        &ExtractedCamera,
        Option<&MainPassResolutionOverride>,
        &ViewPrepassTextures,
        &ViewTextures,
        &ViewProps,
        &ViewBindGroups,
        &PrepassPass,
    )>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (camera, resolution, prepass, textures, props, groups, pass) = view.into_inner();
    let (true, Some(view), Some(group), Some(pipeline)) = (
        props.is_shown_at(PropStage::Scene, &cache),
        groups.plain.get(),
        pass.group.get(),
        pass.pipeline.and_then(|id| cache.get_render_pipeline(id)),
    ) else {
        return;
    };
    let viewport = drawn_viewport(camera, resolution);
    let motion = prepass.motion_vectors.as_ref().filter(|_| textures.layer.motion.is_some());
    let color = motion.map(|motion| Some(motion.get_attachment()));
    let depth = prepass.depth_view().map(|view| RenderPassDepthStencilAttachment {
        view,
        depth_ops: Some(Operations { load: LoadOp::Load, store: StoreOp::Store }),
        stencil_ops: None,
    });
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), PREPASS_SPAN);
    {
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(PREPASS_SPAN),
            color_attachments: color.as_slice(),
            depth_stencil_attachment: depth,
            ..default()
        });
        draw(&mut pass, props, viewport.as_ref(), pipeline, [(view, &[]), (group, &[])]);
    }
    span.end(ctx.command_encoder());
}
