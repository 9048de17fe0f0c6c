//! Draws props into shadow maps.

use bevy::{
    pbr::{ShadowView, ViewLightEntities},
    prelude::*,
    render::{
        diagnostic::RecordDiagnostics,
        render_asset::RenderAssets,
        render_resource::{PipelineCache, RenderPassDescriptor, SpecializedRenderPipelines, StoreOp},
        renderer::{RenderContext, ViewQuery},
    },
};

use super::{maps::MapProps, pipeline::ShadowPipeline};
use crate::gpu::GpuField;

/// The name of the pass's span in Bevy's render diagnostics. There is one per camera, for all of its cascades, and one
/// for every map of a point or spot light.
pub const SHADOW_SPAN: &str = "plenoctree_shadow";

pub(super) fn prepare_pipelines(
    cache: Res<PipelineCache>,
    pipeline: Res<ShadowPipeline>,
    mut specialized: ResMut<SpecializedRenderPipelines<ShadowPipeline>>,
    fields: Res<RenderAssets<GpuField>>,
    mut maps: Query<&mut MapProps>,
) {
    for mut map in &mut maps {
        let MapProps { drawn, pipelines, .. } = &mut *map;
        pipelines.clear();
        pipelines.extend(drawn.iter().map(|prop| {
            let level = prop.on_gpu(&fields)?;
            Some(specialized.specialize(&cache, &pipeline, level.shape.inner_records))
        }));
    }
}

/// Draws into the maps of directional lights, which every camera has its own of.
pub(super) fn draw_cascades(
    camera: ViewQuery<&ViewLightEntities>,
    maps: Query<(&ShadowView, &MapProps)>,
    cache: Res<PipelineCache>,
    fields: Res<RenderAssets<GpuField>>,
    mut ctx: RenderContext,
) {
    let lights = &camera.into_inner().lights;
    draw(maps.iter_many(lights), &cache, &fields, &mut ctx);
}

/// Draws into a map of a point or spot light, which all cameras share.
pub(super) fn draw_shared_map(
    map: ViewQuery<(&ShadowView, &MapProps)>,
    cache: Res<PipelineCache>,
    fields: Res<RenderAssets<GpuField>>,
    mut ctx: RenderContext,
) {
    draw([map.into_inner()].into_iter(), &cache, &fields, &mut ctx);
}

fn draw<'a>(
    maps: impl Iterator<Item = (&'a ShadowView, &'a MapProps)>,
    cache: &PipelineCache,
    fields: &RenderAssets<GpuField>,
    ctx: &mut RenderContext,
) {
    let mut maps = maps.filter(|(_, map)| !map.drawn.is_empty()).peekable();
    if maps.peek().is_none() {
        return;
    }
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), SHADOW_SPAN);
    for (view, map) in maps {
        let Some(group) = map.group.get() else {
            continue;
        };
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(SHADOW_SPAN),
            depth_stencil_attachment: Some(view.depth_attachment.get_attachment(StoreOp::Store)),
            ..default()
        });
        pass.set_bind_group(0, group, &[]);
        for (instance, ((prop, rect), pipeline)) in (0..).zip(map.drawn.iter().zip(&map.rects).zip(&map.pipelines)) {
            let pipeline = pipeline.and_then(|id| cache.get_render_pipeline(id));
            let (Some(level), Some(pipeline)) = (prop.on_gpu(fields), pipeline) else {
                continue;
            };
            pass.set_render_pipeline(pipeline);
            pass.set_bind_group(1, &level.bind_group, &[]);
            pass.set_scissor_rect(rect.min.x, rect.min.y, rect.width(), rect.height());
            pass.draw(0..3, instance..instance + 1);
        }
    }
    span.end(ctx.command_encoder());
}
