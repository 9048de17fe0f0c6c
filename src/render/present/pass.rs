//! Writes the view's target.

use bevy::{
    camera::MainPassResolutionOverride,
    prelude::*,
    render::{
        camera::ExtractedCamera,
        diagnostic::RecordDiagnostics,
        render_resource::{
            BindGroupEntries, CachedRenderPipelineId, PipelineCache, RenderPassDescriptor, SpecializedRenderPipelines,
        },
        renderer::{RenderContext, RenderDevice, ViewQuery},
        view::{ExtractedView, ViewTarget},
    },
};

use super::pipeline::PresentPipeline;
use crate::{
    render::{
        bind_group::KeptBindGroup,
        fullscreen::draw,
        label::LabelTextures,
        target::{TargetKey, target_attachment},
        view::{ViewBindGroups, ViewProps, drawn_viewport},
    },
    stage::PropStage,
};

/// The name of the pass's span in Bevy's render diagnostics.
pub const PRESENT_SPAN: &str = "plenoctree_present";

/// The pipeline of a view, and a bind group for each color texture.
#[derive(Component, Default)]
pub(super) struct PresentPass {
    pipeline: Option<CachedRenderPipelineId>,
    groups: [KeptBindGroup; 2],
}

pub(super) fn prepare_pipelines(
    cache: Res<PipelineCache>,
    pipeline: Res<PresentPipeline>,
    mut specialized: ResMut<SpecializedRenderPipelines<PresentPipeline>>,
    mut views: Query<(&ExtractedView, &ExtractedCamera, &Msaa, &mut ViewProps, &mut PresentPass)>,
) {
    for (view, camera, msaa, mut props, mut pass) in &mut views {
        pass.pipeline = props
            .has_stages
            .then(|| specialized.specialize(&cache, &pipeline, TargetKey::new(view, camera, msaa, props.stage)));
        props.pipelines.extend(pass.pipeline);
    }
}

pub(super) fn prepare_bind_groups(
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    pipeline: Res<PresentPipeline>,
    mut views: Query<(Option<&LabelTextures>, &mut PresentPass)>,
) {
    for (textures, mut pass) in &mut views {
        let Some(textures) = textures else {
            pass.groups = default();
            continue;
        };
        for (group, colors) in pass.groups.iter_mut().zip(textures.both()) {
            let entries = BindGroupEntries::single(colors);
            group.update(&device, &cache, pipeline.0.label, &pipeline.0.layout, &entries);
        }
    }
}

pub(super) fn present_pass(
    InMut(stage): InMut<PropStage>,
    view: ViewQuery<(
        &ExtractedCamera,
        Option<&MainPassResolutionOverride>,
        &ViewTarget,
        &ViewProps,
        &ViewBindGroups,
        &PresentPass,
        &LabelTextures,
    )>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (camera, resolution, target, props, groups, pass, textures) = view.into_inner();
    let current = textures.both().iter().position(|colors| colors.id() == textures.colors().id());
    let (true, Some(view), Some(group), Some(pipeline)) = (
        props.posterizes_at(*stage, &cache),
        groups.plain.get(),
        current.and_then(|current| pass.groups[current].get()),
        pass.pipeline.and_then(|id| cache.get_render_pipeline(id)),
    ) else {
        return;
    };
    let viewport = drawn_viewport(camera, resolution);
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), PRESENT_SPAN);
    {
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(PRESENT_SPAN),
            color_attachments: &[Some(target_attachment(target, props.stage))],
            ..default()
        });
        draw(&mut pass, props, viewport.as_ref(), pipeline, [(view, &[]), (group, &[])]);
    }
    span.end(ctx.command_encoder());
}
