//! Draws the boxes of props that overlap and may be solid.

use bevy::{
    prelude::*,
    render::{
        diagnostic::RecordDiagnostics,
        render_asset::RenderAssets,
        render_resource::{CachedRenderPipelineId, PipelineCache, RenderPassDescriptor, SpecializedRenderPipelines},
        renderer::{RenderContext, ViewQuery},
    },
};

use super::{
    pipeline::{SolidKey, SolidPipeline},
    textures::SolidTextures,
};
use crate::{
    gpu::GpuField,
    render::{
        attachment::{cleared, cleared_depth},
        boxes::BOX_VERTICES,
        view::{Overlap, ViewBindGroups, ViewProps},
    },
};

/// The name of the pass's span in Bevy's render diagnostics.
pub const SOLID_SPAN: &str = "plenoctree_solid";

/// The pipeline of every prop of a view that the pass draws, in drawing order.
#[derive(Component, Default)]
pub(super) struct SolidPipelines(Vec<Option<CachedRenderPipelineId>>);

pub(super) fn prepare_pipelines(
    cache: Res<PipelineCache>,
    pipeline: Res<SolidPipeline>,
    mut specialized: ResMut<SpecializedRenderPipelines<SolidPipeline>>,
    fields: Res<RenderAssets<GpuField>>,
    mut views: Query<(&ViewProps, &Msaa, &mut SolidPipelines)>,
) {
    for (props, msaa, mut pipelines) in &mut views {
        let multisampled = msaa.samples() > 1;
        pipelines.0.clear();
        pipelines.0.extend(props.drawn.iter().map(|prop| {
            let level = prop.on_gpu(&fields).filter(|_| prop.overlap == Overlap::Solid)?;
            let key = SolidKey { inner_records: level.shape.inner_records, multisampled };
            Some(specialized.specialize(&cache, &pipeline, key))
        }));
    }
}

pub(super) fn solid_pass(
    view: ViewQuery<(&SolidTextures, &ViewProps, &ViewBindGroups, &SolidPipelines)>,
    cache: Res<PipelineCache>,
    fields: Res<RenderAssets<GpuField>>,
    mut ctx: RenderContext,
) {
    let (textures, props, groups, pipelines) = view.into_inner();
    let Some(group) = groups.with_depth.get() else {
        return;
    };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), SOLID_SPAN);
    {
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(SOLID_SPAN),
            color_attachments: &[cleared(&textures.prop)],
            depth_stencil_attachment: Some(cleared_depth(&textures.depth)),
            ..default()
        });
        pass.set_bind_group(0, group, &[]);
        // Front to back: of equal depths, the first one stays.
        for (index, (prop, pipeline)) in props.drawn.iter().zip(&pipelines.0).enumerate().rev() {
            let pipeline = pipeline.and_then(|id| cache.get_render_pipeline(id));
            let (Some(level), Some(pipeline)) = (prop.on_gpu(&fields), pipeline) else {
                continue;
            };
            pass.set_render_pipeline(pipeline);
            pass.set_bind_group(1, &level.bind_group, &[]);
            let instance = index as u32;
            pass.draw(0..BOX_VERTICES, instance..instance + 1);
        }
    }
    span.end(ctx.command_encoder());
}
