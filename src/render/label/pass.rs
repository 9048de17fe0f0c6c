//! Assigns labels.

use bevy::{
    camera::MainPassResolutionOverride,
    prelude::*,
    render::{
        camera::ExtractedCamera,
        diagnostic::RecordDiagnostics,
        render_resource::{
            BindGroupEntries, CachedRenderPipelineId, LoadOp, PipelineCache, RenderPassDescriptor,
            SpecializedRenderPipelines,
        },
        renderer::{RenderContext, RenderDevice, ViewQuery},
        view::{ExtractedView, ViewTarget},
    },
};

use super::{
    pipeline::{LabelKey, LabelPipeline},
    textures::LabelTextures,
};
use crate::{
    render::{
        attachment::{cleared, color},
        bind_group::KeptBindGroup,
        fullscreen::draw,
        target::{TargetKey, target_attachment},
        view::{ViewBindGroups, ViewProps, ViewTextures, drawn_viewport},
    },
    stage::PropStage,
};

/// The name of the pass's span in Bevy's render diagnostics.
pub const LABEL_SPAN: &str = "plenoctree_label";

/// The pipeline and bind group of a view.
#[derive(Component, Default)]
pub(super) struct LabelPass {
    pipeline: Option<CachedRenderPipelineId>,
    group: KeptBindGroup,
}

pub(super) fn prepare_pipelines(
    cache: Res<PipelineCache>,
    pipeline: Res<LabelPipeline>,
    mut specialized: ResMut<SpecializedRenderPipelines<LabelPipeline>>,
    mut views: Query<(&ExtractedView, &ExtractedCamera, &Msaa, &mut ViewProps, &mut LabelPass)>,
) {
    for (view, camera, msaa, mut props, mut pass) in &mut views {
        let key = if props.has_stages {
            LabelKey::Textures
        } else {
            LabelKey::Target(TargetKey::new(view, camera, msaa, props.stage))
        };
        let id = specialized.specialize(&cache, &pipeline, key);
        pass.pipeline = Some(id);
        props.pipelines.push(id);
    }
}

pub(super) fn prepare_bind_groups(
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    pipeline: Res<LabelPipeline>,
    mut views: Query<(Option<&ViewTextures>, &mut LabelPass)>,
) {
    for (textures, mut pass) in &mut views {
        let Some(textures) = textures else {
            *pass = default();
            continue;
        };
        let entries = BindGroupEntries::sequential((&textures.even, &textures.layer.color));
        pass.group.update(&device, &cache, pipeline.0.label, &pipeline.0.layout, &entries);
    }
}

pub(super) fn label_pass(
    InMut(stage): InMut<PropStage>,
    view: ViewQuery<(
        &ExtractedCamera,
        Option<&MainPassResolutionOverride>,
        &ViewTarget,
        &ViewProps,
        &ViewBindGroups,
        &LabelPass,
        Option<&LabelTextures>,
    )>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (camera, resolution, target, props, groups, pass, textures) = view.into_inner();
    let (true, Some(view), Some(group), Some(pipeline)) = (
        props.posterizes_at(*stage, &cache),
        groups.plain.get(),
        pass.group.get(),
        pass.pipeline.and_then(|id| cache.get_render_pipeline(id)),
    ) else {
        return;
    };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), LABEL_SPAN);
    {
        let (to_target, to_textures);
        let (attachments, viewport) = match textures {
            Some(textures) => {
                // A negative opacity marks pixels where nothing is drawn.
                let nothing = wgpu::Color { a: -1.0, ..default() };
                to_textures = [Some(color(textures.colors(), LoadOp::Clear(nothing))), cleared(&textures.labels)];
                (to_textures.as_slice(), None)
            }
            None => {
                to_target = [Some(target_attachment(target, props.stage))];
                (to_target.as_slice(), drawn_viewport(camera, resolution))
            }
        };
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(LABEL_SPAN),
            color_attachments: attachments,
            ..default()
        });
        draw(&mut pass, props, viewport.as_ref(), pipeline, [(view, &[]), (group, &[])]);
    }
    span.end(ctx.command_encoder());
}
