//! Runs the blend pass and the patch pass.

use bevy::{
    prelude::*,
    render::{
        camera::ExtractedCamera,
        diagnostic::RecordDiagnostics,
        render_resource::{
            BindGroupEntries, CachedRenderPipelineId, PipelineCache, RenderPassDescriptor, SpecializedRenderPipelines,
            TextureView,
        },
        renderer::{RenderContext, RenderDevice, ViewQuery},
        view::ViewTarget,
    },
};

use super::pipeline::{BlendKey, BlendPipeline};
use crate::{
    render::{
        attachment::{kept, tested},
        bind_group::{KeptBindGroup, PerMainTexture},
        composite::CompositeTextures,
        edges::EdgeTextures,
        fullscreen::draw,
        label::{SHOWN_FORMAT, ShownTexture},
        lighting::ReadLighting,
        target::hidden_samples,
        view::{ViewBindGroups, ViewMemory, ViewProps},
    },
    stage::PropStage,
};

/// The name of the passes' span in Bevy's render diagnostics.
pub const BLEND_SPAN: &str = "plenoctree_blend";

/// The result of the blend pass. A component of views in which the edges of props are smooth.
#[derive(Component)]
pub(in crate::render) struct BlendedTexture(pub TextureView);

/// The pipelines and bind groups of such a view. Until its pipelines are ready, edges are hard.
#[derive(Component, Default)]
pub(in crate::render) struct BlendPass {
    /// Of the blend pass and of the patch pass.
    pipelines: Option<[CachedRenderPipelineId; 2]>,
    blend: PerMainTexture<KeptBindGroup>,
    patch: KeptBindGroup,
}

impl BlendPass {
    /// Returns whether all pipelines that the view needs have been created.
    pub fn are_ready(&self, cache: &PipelineCache) -> bool {
        self.pipelines.iter().flatten().all(|id| cache.get_render_pipeline(*id).is_some())
    }
}

pub(super) fn prepare_textures(
    mut commands: Commands,
    device: Res<RenderDevice>,
    mut views: Query<(Entity, &ViewProps, &mut ViewMemory)>,
) {
    for (entity, props, mut memory) in &mut views {
        let size = props.viewport_size().filter(|_| props.smooths_edges());
        let texture = size.and_then(|size| memory.view(&device, "plenoctree_blended", SHOWN_FORMAT, size));
        match texture {
            Some(texture) => commands.entity(entity).insert(BlendedTexture(texture)),
            None => commands.entity(entity).remove::<BlendedTexture>(),
        };
    }
}

pub(super) fn prepare_pipelines(
    cache: Res<PipelineCache>,
    pipeline: Res<BlendPipeline>,
    mut specialized: ResMut<SpecializedRenderPipelines<BlendPipeline>>,
    mut views: Query<(&ViewProps, Option<&ExtractedCamera>, &Msaa, &ReadLighting, &mut BlendPass)>,
) {
    for (props, camera, msaa, lighting, mut pass) in &mut views {
        let space = camera.and_then(|camera| camera.compositing_space);
        let blend = BlendKey::Blend { samples: hidden_samples(props, msaa), is_lit: lighting.is_lit, space };
        let keys = [blend, BlendKey::Patch];
        pass.pipelines = props.smooths_edges().then(|| keys.map(|key| specialized.specialize(&cache, &pipeline, key)));
    }
}

pub(super) fn prepare_bind_groups(
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    pipeline: Res<BlendPipeline>,
    mut views: Query<(
        Option<(&ViewTarget, &CompositeTextures, &EdgeTextures, &ShownTexture, &BlendedTexture)>,
        &mut BlendPass,
    )>,
) {
    for (textures, mut pass) in &mut views {
        let Some((target, composite, edges, shown, blended)) = textures else {
            (pass.blend, pass.patch) = default();
            continue;
        };
        let (outline, [own, other]) = (&edges.outline, &edges.colors);
        pass.blend.update(target, |group, scene| {
            let entries = (&shown.0, &composite.even, outline, &edges.coverage, own, other, scene);
            let entries = BindGroupEntries::sequential(entries);
            group.update(&device, &cache, pipeline.blend.label, &pipeline.blend.layout, &entries);
        });
        let entries = BindGroupEntries::single(&blended.0);
        pass.patch.update(&device, &cache, pipeline.patch.label, &pipeline.patch.layout, &entries);
    }
}

pub(super) fn blend_pass(
    InMut(stage): InMut<PropStage>,
    view: ViewQuery<(
        (&ViewTarget, &ViewProps),
        (&ViewBindGroups, &ReadLighting),
        &EdgeTextures,
        &ShownTexture,
        &BlendedTexture,
        &BlendPass,
    )>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let ((target, props), (groups, lighting), edges, shown, blended, pass) = view.into_inner();
    let pipeline = |index: usize| cache.get_render_pipeline(pass.pipelines?[index]);
    let (true, Some(view), Some(blend), Some(patch), Some(from_shown), Some(from_blended)) = (
        props.is_shown_at(*stage, &cache),
        groups.plain.get(),
        pipeline(0),
        pipeline(1),
        pass.blend.get(target).and_then(KeptBindGroup::get),
        pass.patch.get(),
    ) else {
        return;
    };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), BLEND_SPAN);
    for (target, pipeline, group) in [(&blended.0, blend, from_shown), (&shown.0, patch, from_blended)] {
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(BLEND_SPAN),
            color_attachments: &[kept(target)],
            depth_stencil_attachment: Some(tested(&edges.mask)),
            ..default()
        });
        if let Some(lighting) = lighting.group.get() {
            pass.set_bind_group(2, lighting, &[]);
        }
        draw(&mut pass, props, None, pipeline, [(view, &[]), (group, &[])]);
    }
    span.end(ctx.command_encoder());
}
