//! Assigns labels.

use bevy::{
    prelude::*,
    render::{
        diagnostic::RecordDiagnostics,
        render_resource::{
            BindGroupEntries, CachedRenderPipelineId, LoadOp, PipelineCache, RenderPassDescriptor,
            SpecializedRenderPipelines,
        },
        renderer::{RenderContext, RenderDevice, ViewQuery},
    },
};

use super::{
    pipeline::{LabelKey, LabelPipeline},
    textures::{LabelTextures, ShownTexture},
};
use crate::{
    render::{
        attachment::{cleared, color, tested},
        bind_group::KeptBindGroup,
        fullscreen::draw,
        kept::{KeptPart, KeptView},
        lighting::ReadLighting,
        view::{ViewBindGroups, ViewProps, ViewTextures},
    },
    stage::PropStage,
};

/// The name of the pass's span in Bevy's render diagnostics.
pub const LABEL_SPAN: &str = "plenoctree_label";

/// The pipelines and the bind group of a view.
#[derive(Component, Default)]
pub(super) struct LabelPass {
    /// Without a depth test, and with one.
    pipelines: Option<[CachedRenderPipelineId; 2]>,
    group: KeptBindGroup,
}

pub(super) fn prepare_pipelines(
    cache: Res<PipelineCache>,
    pipeline: Res<LabelPipeline>,
    mut specialized: ResMut<SpecializedRenderPipelines<LabelPipeline>>,
    mut views: Query<(&mut ViewProps, &ReadLighting, &mut LabelPass)>,
) {
    for (mut props, lighting, mut pass) in &mut views {
        let ids = [false, true].map(|tests_depth| {
            let key = LabelKey { has_stages: props.has_stages, is_lit: lighting.is_lit, tests_depth };
            specialized.specialize(&cache, &pipeline, key)
        });
        pass.pipelines = Some(ids);
        props.pipelines.extend(ids);
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
            pass.group = default();
            continue;
        };
        let entries = BindGroupEntries::sequential((&textures.even, &textures.layer.color));
        pass.group.update(&device, &cache, pipeline.pass.label, &pipeline.pass.layout, &entries);
    }
}

pub(super) fn label_pass(
    InMut(stage): InMut<PropStage>,
    view: ViewQuery<(
        (&ViewProps, &ViewTextures),
        (&ViewBindGroups, &ReadLighting),
        &KeptView,
        &LabelPass,
        &ShownTexture,
        Option<&LabelTextures>,
    )>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let ((props, textures), (groups, lighting), kept, pass, shown, stages) = view.into_inner();
    let clears = kept.is_drawn(KeptPart::Labels);
    let (true, Some(view), Some(group), Some(pipeline)) = (
        props.posterizes_at(*stage, &cache),
        groups.plain.get(),
        pass.group.get(),
        pass.pipelines.and_then(|ids| cache.get_render_pipeline(ids[usize::from(clears)])),
    ) else {
        return;
    };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), LABEL_SPAN);
    {
        // A negative opacity marks pixels where nothing is drawn.
        let nothing = LoadOp::Clear(wgpu::Color { a: -1.0, ..default() });
        let load = if clears { nothing } else { LoadOp::Load };
        let mut attachments = vec![Some(color(&shown.0, load))];
        attachments.extend(stages.map(|textures| cleared(&textures.labels)));
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(LABEL_SPAN),
            color_attachments: &attachments,
            depth_stencil_attachment: clears.then(|| tested(&textures.layer.depth)),
            ..default()
        });
        if let Some(lighting) = lighting.group.get() {
            pass.set_bind_group(2, lighting, &[]);
        }
        draw(&mut pass, props, None, pipeline, [(view, &[]), (group, &[])]);
    }
    span.end(ctx.command_encoder());
}
