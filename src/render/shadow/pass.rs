//! Draws props into shadow maps.

use bevy::{
    pbr::{ShadowView, ViewLightEntities},
    prelude::*,
    render::{
        diagnostic::RecordDiagnostics,
        render_phase::TrackedRenderPass,
        render_resource::{BindGroup, PipelineCache, RenderPassColorAttachment, RenderPassDescriptor, StoreOp},
        renderer::{RenderContext, ViewQuery},
    },
};

use super::{
    maps::{Drawn, MapProps},
    pipeline::SHADOW_SPAN,
};

/// Draws into the maps of a view: those of directional lights, if it is a camera, or else the map of a point or spot
/// light, which is a view of its own, because all cameras share it.
pub(super) fn draw_maps(
    view: ViewQuery<Option<&ViewLightEntities>>,
    mut maps: Query<(&ShadowView, &mut MapProps)>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let own = [view.entity()];
    let views = view.into_inner().map_or(&own[..], |camera| &camera.lights[..]);
    if maps.iter_many(views).all(|(_, map)| map.drawn.is_empty()) {
        return;
    }
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), SHADOW_SPAN);
    let mut maps = maps.iter_many_mut(views);
    while let Some((view, mut map)) = maps.fetch_next() {
        draw(view, &mut map, &cache, &mut ctx);
    }
    span.end(ctx.command_encoder());
}

fn draw(view: &ShadowView, map: &mut MapProps, cache: &PipelineCache, ctx: &mut RenderContext) {
    let MapProps { filled, drawn, cached, group, .. } = map;
    let (false, Some(group)) = (drawn.is_empty(), &*group) else {
        return;
    };
    for calls in filled.chunk_by(|a, b| a.entity == b.entity) {
        let Some(tile) = calls.first().and_then(|call| cached.tile(call.entity)) else {
            continue;
        };
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(SHADOW_SPAN),
            color_attachments: &[Some(RenderPassColorAttachment {
                view: &tile.texture,
                depth_slice: None,
                resolve_target: None,
                ops: default(),
            })],
            ..default()
        });
        draw_calls(&mut pass, group, calls, cache);
        tile.is_filled = true;
    }
    let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
        label: Some(SHADOW_SPAN),
        depth_stencil_attachment: Some(view.depth_attachment.get_attachment(StoreOp::Store)),
        ..default()
    });
    draw_calls(&mut pass, group, drawn, cache);
}

fn draw_calls<'a>(
    pass: &mut TrackedRenderPass<'a>,
    group: &'a BindGroup,
    calls: &'a [Drawn],
    cache: &'a PipelineCache,
) {
    pass.set_bind_group(0, group, &[]);
    for call in calls {
        let Some(pipeline) = cache.get_render_pipeline(call.pipeline) else {
            continue;
        };
        pass.set_render_pipeline(pipeline);
        pass.set_bind_group(1, &call.group, &[]);
        pass.set_scissor_rect(call.rect.min.x, call.rect.min.y, call.rect.width(), call.rect.height());
        pass.draw(0..3, call.instance..call.instance + 1);
    }
}
