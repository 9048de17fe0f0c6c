//! Assigns labels.

use bevy::{
    prelude::*,
    render::{
        diagnostic::RecordDiagnostics,
        render_resource::{BindGroupEntries, LoadOp, PipelineCache, RenderPassDescriptor},
        renderer::{RenderContext, RenderDevice, ViewQuery},
    },
};

use super::{
    pipeline::LabelPipelines,
    textures::{LabelTextures, ShownTexture},
};
use crate::{
    render::{
        attachment::{cleared, color},
        bind_group::KeptBindGroup,
        fullscreen::draw,
        kept::{KeptPart, KeptView},
        view::{ViewBindGroups, ViewProps, ViewTextures},
    },
    stage::PropStage,
};

/// The name of the pass's span in Bevy's render diagnostics.
pub const LABEL_SPAN: &str = "plenoctree_label";

/// The bind group of a view.
#[derive(Component, Default)]
pub(super) struct LabelBindGroup(KeptBindGroup);

pub(super) fn require_pipelines(label: Res<LabelPipelines>, mut views: Query<&mut ViewProps>) {
    for mut props in &mut views {
        let id = label.id(props.has_stages);
        props.pipelines.push(id);
    }
}

pub(super) fn prepare_bind_groups(
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    label: Res<LabelPipelines>,
    mut views: Query<(Option<&ViewTextures>, &mut LabelBindGroup)>,
) {
    for (textures, mut group) in &mut views {
        let Some(textures) = textures else {
            *group = default();
            continue;
        };
        let entries = BindGroupEntries::sequential((&textures.even, &textures.layer.color));
        group.0.update(&device, &cache, label.shared.label, &label.shared.layout, &entries);
    }
}

pub(super) fn label_pass(
    InMut(stage): InMut<PropStage>,
    view: ViewQuery<(&ViewProps, &ViewBindGroups, &KeptView, &LabelBindGroup, &ShownTexture, Option<&LabelTextures>)>,
    cache: Res<PipelineCache>,
    label: Res<LabelPipelines>,
    mut ctx: RenderContext,
) {
    let (props, groups, kept, group, shown, stages) = view.into_inner();
    let (true, Some(view), Some(group), Some(pipeline)) = (
        props.posterizes_at(*stage, &cache),
        groups.plain.get(),
        group.0.get(),
        cache.get_render_pipeline(label.id(stages.is_some())),
    ) else {
        return;
    };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), LABEL_SPAN);
    {
        // A negative opacity marks pixels where nothing is drawn.
        let nothing = LoadOp::Clear(wgpu::Color { a: -1.0, ..default() });
        let load = if kept.is_drawn(KeptPart::Labels) { nothing } else { LoadOp::Load };
        let mut attachments = vec![Some(color(&shown.0, load))];
        attachments.extend(stages.map(|textures| cleared(&textures.labels)));
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(LABEL_SPAN),
            color_attachments: &attachments,
            ..default()
        });
        draw(&mut pass, props, None, pipeline, [(view, &[]), (group, &[])]);
    }
    span.end(ctx.command_encoder());
}
