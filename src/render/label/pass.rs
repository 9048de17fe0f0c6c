//! Assigns labels.

use bevy::{
    camera::MainPassResolutionOverride,
    prelude::*,
    render::{
        camera::ExtractedCamera,
        diagnostic::RecordDiagnostics,
        render_resource::{
            BindGroup, BindGroupEntries, CachedRenderPipelineId, LoadOp, PipelineCache, RenderPassDescriptor,
            RenderPipeline, SpecializedRenderPipelines,
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
        edges::EdgeTextures,
        fullscreen::draw,
        target::{TargetKey, target_attachment},
        view::{ViewBindGroups, ViewProps, ViewTextures, drawn_viewport},
    },
    stage::PropStage,
};

/// The name of the pass's span in Bevy's render diagnostics.
pub const LABEL_SPAN: &str = "plenoctree_label";

/// The pipelines and bind groups of a view.
#[derive(Component, Default)]
pub(super) struct LabelPass {
    hard: Variant,
    /// In views in which any edges are smooth. Until its pipeline is there, edges are hard.
    smooth: Variant,
}

#[derive(Default)]
struct Variant {
    pipeline: Option<CachedRenderPipelineId>,
    group: KeptBindGroup,
}

impl Variant {
    fn get<'a>(&'a self, cache: &'a PipelineCache) -> Option<(&'a BindGroup, &'a RenderPipeline)> {
        Some((self.group.get()?, cache.get_render_pipeline(self.pipeline?)?))
    }
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
        let id = specialized.specialize(&cache, &pipeline, (key, false));
        pass.hard.pipeline = Some(id);
        props.pipelines.push(id);
        pass.smooth.pipeline = props.smooths_edges().then(|| specialized.specialize(&cache, &pipeline, (key, true)));
    }
}

pub(super) fn prepare_bind_groups(
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    pipeline: Res<LabelPipeline>,
    mut views: Query<(Option<&ViewTextures>, Option<&EdgeTextures>, &mut LabelPass)>,
) {
    for (textures, edges, mut pass) in &mut views {
        let Some(textures) = textures else {
            *pass = default();
            continue;
        };
        let entries = BindGroupEntries::sequential((&textures.even, &textures.layer.color));
        pass.hard.group.update(&device, &cache, pipeline.hard.label, &pipeline.hard.layout, &entries);
        let Some(edges) = edges else {
            pass.smooth.group = default();
            continue;
        };
        let (outline, [own, other]) = (&edges.outline, &edges.colors);
        let entries = (&textures.even, &textures.layer.color, outline, &edges.coverage, own, other);
        let entries = BindGroupEntries::sequential(entries);
        pass.smooth.group.update(&device, &cache, pipeline.smooth.label, &pipeline.smooth.layout, &entries);
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
    let (true, Some(view), Some((group, pipeline))) = (
        props.posterizes_at(*stage, &cache),
        groups.plain.get(),
        pass.smooth.get(&cache).or_else(|| pass.hard.get(&cache)),
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
