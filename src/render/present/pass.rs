//! Writes the view's target.

use bevy::{
    camera::MainPassResolutionOverride,
    prelude::*,
    render::{
        camera::ExtractedCamera,
        diagnostic::RecordDiagnostics,
        render_resource::{
            BindGroup, BindGroupEntries, CachedRenderPipelineId, PipelineCache, RenderPassDescriptor, RenderPipeline,
            SpecializedRenderPipelines,
        },
        renderer::{RenderContext, RenderDevice, ViewQuery},
        view::{ExtractedView, ViewTarget},
    },
};

use super::pipeline::PresentPipeline;
use crate::{
    render::{
        bind_group::KeptBindGroup,
        edges::EdgeTextures,
        fullscreen::draw,
        label::{LabelTextures, ShownTexture},
        target::{TargetKey, hidden_samples, target_attachment},
        view::{ViewBindGroups, ViewProps, drawn_viewport},
    },
    stage::PropStage,
};

/// The name of the pass's span in Bevy's render diagnostics.
pub const PRESENT_SPAN: &str = "plenoctree_present";

/// The pipelines and bind groups of a view.
#[derive(Component, Default)]
pub(super) struct PresentPass {
    whole: Option<CachedRenderPipelineId>,
    /// One for each color texture of custom stages. Without them, only the first one is used.
    groups: [KeptBindGroup; 2],
    /// If samples of the target may be hidden. Until its pipeline is ready, all are written.
    hidden: Option<CachedRenderPipelineId>,
    hidden_group: KeptBindGroup,
}

impl PresentPass {
    fn get<'a>(
        &'a self,
        textures: Option<&LabelTextures>,
        cache: &'a PipelineCache,
    ) -> Option<(&'a BindGroup, &'a RenderPipeline)> {
        if let (Some(group), Some(id)) = (self.hidden_group.get(), self.hidden)
            && let Some(pipeline) = cache.get_render_pipeline(id)
        {
            return Some((group, pipeline));
        }
        let is_current =
            |textures: &LabelTextures| textures.both().iter().position(|colors| colors.id() == textures.colors().id());
        let current = textures.map_or(Some(0), is_current)?;
        Some((self.groups[current].get()?, cache.get_render_pipeline(self.whole?)?))
    }
}

pub(super) fn prepare_pipelines(
    cache: Res<PipelineCache>,
    pipeline: Res<PresentPipeline>,
    mut specialized: ResMut<SpecializedRenderPipelines<PresentPipeline>>,
    mut views: Query<(&ExtractedView, &ExtractedCamera, &Msaa, &mut ViewProps, &mut PresentPass)>,
) {
    for (view, camera, msaa, mut props, mut pass) in &mut views {
        let target = TargetKey::new(view, camera, msaa, props.stage);
        let mut of = |samples| specialized.specialize(&cache, &pipeline, (target, samples));
        let whole = of(None);
        pass.whole = Some(whole);
        props.pipelines.push(whole);
        pass.hidden = hidden_samples(&props, msaa).filter(|_| props.smooths_edges()).map(|samples| of(Some(samples)));
    }
}

pub(super) fn prepare_bind_groups(
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    pipeline: Res<PresentPipeline>,
    mut views: Query<(Option<&ShownTexture>, Option<&LabelTextures>, Option<&EdgeTextures>, &mut PresentPass)>,
) {
    for (shown, textures, edges, mut pass) in &mut views {
        let Some(shown) = shown else {
            *pass = default();
            continue;
        };
        let PresentPass { groups, hidden, hidden_group, .. } = &mut *pass;
        let PresentPipeline { whole, hidden: with_hidden } = &*pipeline;
        let [first, second] = groups;
        let entries = BindGroupEntries::single(&shown.0);
        first.update(&device, &cache, whole.label, &whole.layout, &entries);
        match textures {
            Some(textures) => {
                let entries = BindGroupEntries::single(&textures.both()[1]);
                second.update(&device, &cache, whole.label, &whole.layout, &entries);
            }
            None => *second = default(),
        }
        match edges.filter(|_| hidden.is_some()) {
            Some(edges) => {
                let entries = BindGroupEntries::sequential((&shown.0, &edges.outline, &edges.coverage));
                hidden_group.update(&device, &cache, with_hidden.label, &with_hidden.layout, &entries);
            }
            None => *hidden_group = default(),
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
        Option<&LabelTextures>,
    )>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (camera, resolution, target, props, groups, pass, textures) = view.into_inner();
    let (true, Some(view), Some((group, pipeline))) =
        (props.is_shown_at(*stage, &cache), groups.plain.get(), pass.get(textures, &cache))
    else {
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
