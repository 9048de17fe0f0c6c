//! Assigns labels.

use bevy::{
    prelude::*,
    render::{
        camera::ExtractedCamera,
        diagnostic::RecordDiagnostics,
        render_resource::{
            BindGroupEntries, CachedRenderPipelineId, LoadOp, PipelineCache, RenderPassDescriptor,
            SpecializedRenderPipelines,
        },
        renderer::{RenderContext, RenderDevice, ViewQuery},
        view::ViewTarget,
    },
};

use super::{
    pipeline::{LabelKey, LabelPipeline, LabelSource},
    textures::{LabelTextures, ShownTexture},
};
use crate::{
    render::{
        attachment::{cleared, color, tested},
        bind_group::{KeptBindGroup, PerMainTexture},
        composite::CompositeTextures,
        fullscreen::draw,
        kept::{KeptPart, KeptView},
        lighting::ReadLighting,
        view::{ViewBindGroups, ViewProps, ViewTextures},
    },
    stage::PropStage,
};

/// The name of the pass's span in Bevy's render diagnostics.
pub const LABEL_SPAN: &str = "plenoctree_label";

/// The pipelines and bind groups of a view.
#[derive(Component, Default)]
pub(super) struct LabelPass {
    /// For views in which anything is posterized, and for others. Each without a depth test, and with one.
    pipelines: Option<[[CachedRenderPipelineId; 2]; 2]>,
    groups: PerMainTexture<KeptBindGroup>,
}

pub(super) fn prepare_pipelines(
    cache: Res<PipelineCache>,
    pipeline: Res<LabelPipeline>,
    mut specialized: ResMut<SpecializedRenderPipelines<LabelPipeline>>,
    mut views: Query<(&ExtractedCamera, &mut ViewProps, &ReadLighting, &mut LabelPass)>,
) {
    for (camera, mut props, lighting, mut pass) in &mut views {
        // Require all, so that no frame waits for pipelines when a prop begins or ceases to be posterized.
        let ids = [LabelSource::Composite, LabelSource::Scene(camera.compositing_space)].map(|source| {
            [false, true].map(|tests_depth| {
                let key = LabelKey { source, has_stages: props.has_stages, is_lit: lighting.is_lit, tests_depth };
                specialized.specialize(&cache, &pipeline, key)
            })
        });
        pass.pipelines = Some(ids);
        props.pipelines.extend(ids.as_flattened());
    }
}

pub(super) fn prepare_bind_groups(
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    pipeline: Res<LabelPipeline>,
    mut views: Query<(Option<&ViewTextures>, Option<&CompositeTextures>, Option<&ViewTarget>, &mut LabelPass)>,
) {
    for (textures, composite, target, mut pass) in &mut views {
        let (Some(textures), Some(target)) = (textures, target) else {
            pass.groups = default();
            continue;
        };
        pass.groups.update(target, |group, scene| {
            let (pass, source) = match composite {
                Some(composite) => (&pipeline.posterized, &composite.even),
                None => (&pipeline.as_trained, scene),
            };
            let entries = BindGroupEntries::sequential((source, &textures.layer.color));
            group.update(&device, &cache, pass.label, &pass.layout, &entries);
        });
    }
}

pub(super) fn label_pass(
    InMut(stage): InMut<PropStage>,
    view: ViewQuery<(
        (&ViewTarget, &ViewProps),
        (&ViewTextures, Option<&CompositeTextures>),
        (&ViewBindGroups, &ReadLighting),
        &KeptView,
        &LabelPass,
        &ShownTexture,
        Option<&LabelTextures>,
    )>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let ((target, props), (textures, composite), (groups, lighting), kept, pass, shown, stages) = view.into_inner();
    let clears = kept.is_drawn(KeptPart::Labels);
    let pipeline = pass.pipelines.map(|ids| ids[usize::from(composite.is_none())][usize::from(clears)]);
    let (true, Some(view), Some(group), Some(pipeline)) = (
        props.is_shown_at(*stage, &cache),
        groups.plain.get(),
        pass.groups.get(target).and_then(KeptBindGroup::get),
        pipeline.and_then(|id| cache.get_render_pipeline(id)),
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
