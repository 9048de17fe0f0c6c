//! Draws the light that reaches props.

use bevy::{
    light::ShadowFilteringMethod,
    pbr::{ExtractedPointLight, ViewLightsUniformOffset},
    prelude::*,
    render::{
        diagnostic::RecordDiagnostics,
        render_resource::{
            CachedRenderPipelineId, LoadOp, PipelineCache, RenderPassDescriptor, SpecializedRenderPipelines,
        },
        renderer::{RenderContext, ViewQuery},
        view::ViewUniformOffset,
    },
};

use super::{
    ReadLighting,
    pipeline::{LightingKey, LightingPipeline},
    prepare::ViewLighting,
};
use crate::render::{
    attachment::{color, tested},
    view::{ViewProps, ViewTextures},
};

/// The name of the pass's span in Bevy's render diagnostics.
pub const LIGHTING_SPAN: &str = "plenoctree_lighting";

/// The pipelines of a view. Both are compiled from the start, so that props keep their light when the first lamp
/// appears.
#[derive(Component)]
pub(super) struct LightingPass {
    without_lamps: CachedRenderPipelineId,
    with_lamps: CachedRenderPipelineId,
}

pub(super) fn prepare_pipelines(
    mut commands: Commands,
    cache: Res<PipelineCache>,
    pipeline: Res<LightingPipeline>,
    mut specialized: ResMut<SpecializedRenderPipelines<LightingPipeline>>,
    mut views: Query<(Entity, Option<&ShadowFilteringMethod>, &ReadLighting, &mut ViewProps)>,
) {
    for (entity, method, lighting, mut props) in &mut views {
        if lighting.is_lit {
            let is_hard = method == Some(&ShadowFilteringMethod::Hardware2x2);
            let [without_lamps, with_lamps] =
                [false, true].map(|lamps| specialized.specialize(&cache, &pipeline, LightingKey { is_hard, lamps }));
            commands.entity(entity).insert(LightingPass { without_lamps, with_lamps });
            props.pipelines.extend([without_lamps, with_lamps]);
        }
    }
}

pub(super) fn lighting_pass(
    view: ViewQuery<(
        &ViewProps,
        &ViewTextures,
        &ViewLighting,
        &LightingPass,
        Option<(&ViewUniformOffset, &ViewLightsUniformOffset)>,
    )>,
    lamps: Query<(), With<ExtractedPointLight>>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (props, textures, lighting, pipelines, offsets) = view.into_inner();
    let Some(light) = &lighting.light else {
        return;
    };
    let pipeline = if lamps.is_empty() { pipelines.without_lamps } else { pipelines.with_lamps };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), LIGHTING_SPAN);
    {
        // White light, none of which is blocked.
        let all = LoadOp::Clear(wgpu::Color { a: 0.0, ..wgpu::Color::WHITE });
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(LIGHTING_SPAN),
            color_attachments: &[Some(color(light, all))],
            depth_stencil_attachment: Some(tested(&textures.layer.depth)),
            ..default()
        });
        if let (Some(pipeline), Some(lights), Some(group), Some((view, gpu_lights))) =
            (cache.get_render_pipeline(pipeline), &lighting.lights, lighting.props.get(), offsets)
            && !props.rect.is_empty()
        {
            let (corner, size) = (props.rect.min, props.rect.size());
            pass.set_scissor_rect(corner.x, corner.y, size.x, size.y);
            pass.set_render_pipeline(pipeline);
            pass.set_bind_group(0, lights, &[view.offset, gpu_lights.offset]);
            pass.set_bind_group(1, group, &[]);
            pass.draw(0..3, 0..1);
        }
    }
    span.end(ctx.command_encoder());
}
