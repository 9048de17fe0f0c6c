//! The posterize pass: composite, bilateral filter, labels. Section 4 of the method.

use std::num::NonZero;

use bevy::{
    camera::MainPassResolutionOverride,
    prelude::*,
    render::{
        camera::ExtractedCamera,
        diagnostic::RecordDiagnostics,
        render_resource::{
            BindGroup, BindGroupEntries, BufferBinding, LoadOp, Operations, PipelineCache, RenderPassColorAttachment,
            RenderPassDepthStencilAttachment, RenderPassDescriptor, RenderPipeline, StoreOp, TextureView,
            TextureViewId,
        },
        renderer::{RenderContext, RenderDevice, ViewQuery},
        view::{ViewDepthTexture, ViewTarget},
    },
};

use super::{
    pipelines::{
        CompositePipeline, DepthPipeline, FilterPipelines, ITERATION_STRIDE, LabelPipeline, PosterizePipelines,
    },
    textures::{PropTextures, drawn_viewport},
    view::{ViewLayouts, ViewProps},
};
use crate::view::PropStage;

/// Name of the pass's span in Bevy's render diagnostics.
pub const POSTERIZE_SPAN: &str = "plenoctree_posterize";

/// The bind groups of one view.
#[derive(Component)]
pub(super) struct PosterizeBindGroups {
    view: BindGroup,
    /// One for each main texture that the target may be drawing to, with its identity.
    composite: [(TextureViewId, BindGroup); 2],
    horizontal: BindGroup,
    vertical: BindGroup,
    label: BindGroup,
    depth: BindGroup,
}

pub(super) fn prepare_bind_groups(
    mut commands: Commands,
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    layouts: Res<ViewLayouts>,
    composite: Res<CompositePipeline>,
    filter: Res<FilterPipelines>,
    label: Res<LabelPipeline>,
    depth: Res<DepthPipeline>,
    views: Query<(Entity, &ViewProps, &PropTextures, &ViewTarget)>,
) {
    for (entity, props, textures, target) in &views {
        let Some((view, list, colors)) = props.bindings() else {
            commands.entity(entity).remove::<PosterizeBindGroups>();
            continue;
        };
        let group = |name: &'static str, layout, entries: &[_]| {
            device.create_bind_group(name, &cache.get_bind_group_layout(layout), entries)
        };
        let filter_group = |source| {
            let iteration = BufferBinding { buffer: &filter.iterations, offset: 0, size: NonZero::new(16) };
            group("plenoctree_filter", &filter.layout, &BindGroupEntries::sequential((source, iteration)))
        };
        commands.entity(entity).insert(PosterizeBindGroups {
            view: group(
                "plenoctree_picture_view",
                &layouts.picture,
                &BindGroupEntries::sequential((view, list, colors)),
            ),
            composite: [target.main_texture_view(), target.main_texture_other_view()].map(|scene| {
                let entries = (&textures.layer.color, &textures.layer.owner, scene);
                (scene.id(), group(composite.0.label, &composite.0.layout, &BindGroupEntries::sequential(entries)))
            }),
            horizontal: filter_group(&textures.even),
            vertical: filter_group(&textures.odd),
            label: group(
                label.0.label,
                &label.0.layout,
                &BindGroupEntries::sequential((&textures.even, &textures.layer.color)),
            ),
            depth: group(
                depth.0.label,
                &depth.0.layout,
                &BindGroupEntries::sequential((&textures.layer.owner, &textures.layer.depth)),
            ),
        });
    }
}

/// Draws the view at one of the places in the frame, if it is the view's.
pub(super) fn posterize_pass(
    InMut(stage): InMut<PropStage>,
    view: ViewQuery<(
        &ExtractedCamera,
        Option<&MainPassResolutionOverride>,
        &ViewTarget,
        &ViewDepthTexture,
        &ViewProps,
        &PropTextures,
        &PosterizePipelines,
        &PosterizeBindGroups,
    )>,
    cache: Res<PipelineCache>,
    filter: Res<FilterPipelines>,
    mut ctx: RenderContext,
) {
    let (camera, resolution, view_target, scene_depth, props, textures, pipelines, groups) = view.into_inner();
    if props.stage != *stage || props.rect.is_empty() {
        return;
    }
    let scene = view_target.main_texture_view().id();
    let Some((_, scene)) = groups.composite.iter().find(|(id, _)| *id == scene) else {
        return;
    };
    let (Some(composite), Some(horizontal), Some(vertical), Some(label), Some(depth)) = (
        cache.get_render_pipeline(pipelines.composite),
        cache.get_render_pipeline(filter.horizontal),
        cache.get_render_pipeline(filter.vertical),
        cache.get_render_pipeline(pipelines.label),
        cache.get_render_pipeline(pipelines.depth),
    ) else {
        return;
    };
    let viewport = drawn_viewport(camera, resolution);
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), POSTERIZE_SPAN);

    let mut draw = |target: Target, pipeline: &RenderPipeline, group, offsets: &[u32]| {
        let mut descriptor = RenderPassDescriptor { label: Some(POSTERIZE_SPAN), ..default() };
        let (attachments, composited);
        match &target {
            Target::Composite => {
                composited = [onto(&textures.even), onto(&textures.odd)];
                descriptor.color_attachments = &composited[..if props.iterations > 0 { 2 } else { 1 }];
            }
            Target::Filtered(picture) => {
                attachments = [onto(picture)];
                descriptor.color_attachments = &attachments;
                // Only for its test.
                descriptor.depth_stencil_attachment = Some(RenderPassDepthStencilAttachment {
                    view: &textures.layer.depth,
                    depth_ops: None,
                    stencil_ops: None,
                });
            }
            Target::Screen => {
                attachments = [Some(match props.stage {
                    PropStage::Scene => view_target.get_color_attachment(),
                    // Post-processing goes on with the resolved texture.
                    PropStage::Display => view_target.get_unsampled_color_attachment(),
                })];
                descriptor.color_attachments = &attachments;
            }
            Target::Depth => {
                descriptor.depth_stencil_attachment = Some(scene_depth.get_attachment(StoreOp::Store));
            }
        }
        let mut pass = ctx.begin_tracked_render_pass(descriptor);
        let (mut corner, size) = (props.rect.min, props.rect.size());
        if let (Target::Screen | Target::Depth, Some(viewport)) = (target, &viewport) {
            pass.set_camera_viewport(viewport);
            corner += viewport.physical_position;
        }
        pass.set_scissor_rect(corner.x, corner.y, size.x, size.y);
        pass.set_render_pipeline(pipeline);
        pass.set_bind_group(0, &groups.view, &[]);
        pass.set_bind_group(1, group, offsets);
        pass.draw(0..3, 0..1);
    };
    draw(Target::Composite, composite, scene, &[]);
    for iteration in 0..props.iterations {
        let offset = [iteration * ITERATION_STRIDE];
        draw(Target::Filtered(&textures.odd), horizontal, &groups.horizontal, &offset);
        draw(Target::Filtered(&textures.even), vertical, &groups.vertical, &offset);
    }
    draw(Target::Screen, label, &groups.label, &[]);
    draw(Target::Depth, depth, &groups.depth, &[]);
    span.end(ctx.command_encoder());
}

/// What a draw of the pass writes.
#[derive(Clone, Copy)]
enum Target<'a> {
    /// The pictures of the filter.
    Composite,
    /// One of them, where there is something of a prop.
    Filtered(&'a TextureView),
    /// The view's target.
    Screen,
    /// The view's depth.
    Depth,
}

/// An attachment that keeps the pixels that are not drawn.
pub(super) fn onto(view: &TextureView) -> Option<RenderPassColorAttachment<'_>> {
    Some(RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: Operations { load: LoadOp::Load, store: StoreOp::Store },
    })
}
