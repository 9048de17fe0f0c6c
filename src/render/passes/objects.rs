//! Draws transparent objects again, over props that are drawn at [`PropStage::Display`].
//!
//! Bevy draws transparent objects before tonemapping, so that the props cover them. Where a prop is solid, those in front
//! of it are drawn once more, into a separate texture, and blended over the prop. This happens only for cameras that have
//! both.

use bevy::{
    core_pipeline::{core_3d::Transparent3d, schedule::Core3d},
    prelude::*,
    render::{
        diagnostic::RecordDiagnostics,
        render_phase::ViewSortedRenderPhases,
        render_resource::{BlendState, LoadOp, Operations, RenderPassColorAttachment, RenderPassDescriptor, StoreOp},
        renderer::{RenderContext, ViewQuery},
        view::{ExtractedView, ViewDepthTexture},
    },
};

use crate::{
    render::{
        frame::{Area, Blend, Input, Output, Pass, Place, Program, Rays, Slot},
        plan::{Plan, PropView},
    },
    sets::PlenOctreeRenderSystems,
};

pub(super) const OBJECTS: &str = "plenoctree_objects";

/// Blends the objects over props.
pub(super) fn objects(plan: &Plan) -> Option<Pass> {
    let program =
        Program { blends: vec![Blend::With(BlendState::PREMULTIPLIED_ALPHA_BLENDING)], ..Program::new("objects") };
    plan.has_objects.then(|| Pass {
        reads: vec![vec![Input::Texture(Slot::Depth(Rays::Pixels)), Input::Texture(Slot::Objects)]],
        writes: vec![Some(Output::Target)],
        area: Area::Target,
        holds: if plan.samples > 1 { vec![Slot::ObjectSamples] } else { vec![] },
        ..Pass::fullscreen(OBJECTS, Place::Objects, None, program)
    })
}

pub(super) fn plugin(render_app: &mut SubApp) {
    render_app.add_systems(Core3d, draw_objects.in_set(PlenOctreeRenderSystems::Objects));
}

/// Draws the objects over nothing.
pub(in crate::render) fn draw_objects(
    world: &World,
    view: ViewQuery<(&ExtractedView, &ViewDepthTexture, &PropView)>,
    phases: Res<ViewSortedRenderPhases<Transparent3d>>,
    mut ctx: RenderContext,
) {
    let entity = view.entity();
    let (extracted, depth, view) = view.into_inner();
    let has_objects = view.passes.iter().any(|(pass, _)| pass.place == Place::Objects);
    let (true, Some(resolved), Some(phase)) =
        (has_objects, view.textures.get(Slot::Objects), phases.get(&extracted.retained_view_entity))
    else {
        return;
    };
    let ops = Operations { load: LoadOp::Clear(wgpu::Color::TRANSPARENT), store: StoreOp::Store };
    let (view_of, resolve_target) = match view.textures.get(Slot::ObjectSamples).filter(|_| view.plan.samples > 1) {
        Some(samples) => (samples, Some(&**resolved)),
        None => (resolved, None),
    };
    let attachment = RenderPassColorAttachment { view: view_of, depth_slice: None, resolve_target, ops };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), OBJECTS);
    {
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(OBJECTS),
            color_attachments: &[Some(attachment)],
            // It already has the depth of the props.
            depth_stencil_attachment: Some(depth.get_attachment(StoreOp::Store)),
            ..default()
        });
        pass.set_camera_viewport(&view.plan.viewport);
        if let Err(error) = phase.render(&mut pass, world, entity) {
            error!("failed to draw transparent objects over props: {error}");
        }
    }
    span.end(ctx.command_encoder());
}
