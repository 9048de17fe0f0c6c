//! Draws transparent objects again, over props that are drawn at [`PropPlacement::Display`].
//!
//! Bevy draws transparent objects before tonemapping, so that the props cover them. They are drawn once more, over the
//! light of the props alone, because blending depends on what is behind: *under_objects* writes that light to a separate
//! texture, Bevy's phase draws over it, and *objects* replaces the props' share of each pixel by the result. This happens
//! only for cameras that have both.

use bevy::{
    core_pipeline::{core_3d::Transparent3d, schedule::Core3d},
    prelude::*,
    render::{
        diagnostic::RecordDiagnostics,
        render_phase::ViewSortedRenderPhases,
        render_resource::{LoadOp, Operations, RenderPassColorAttachment, RenderPassDescriptor, StoreOp},
        renderer::{RenderContext, ViewQuery},
        view::{ExtractedView, ViewDepthTexture},
    },
};

use super::labels::{shown_after, space};
use crate::{
    render::{
        frame::{Area, Clear, Input, Output, Pass, Place, Program, PropView, RaySet, Slot},
        plan::{Feature, Plan},
    },
    sets::PlenOctreeRenderSystems,
};

pub(super) const OBJECTS: &str = "plenoctree_objects";
pub(super) const UNDER_OBJECTS: &str = "plenoctree_under_objects";

/// Writes what objects are blended over.
pub(super) fn under_objects(plan: &Plan) -> Option<Pass> {
    let (slot, samples) = match plan.samples {
        1 => (Slot::Objects, 1),
        samples => (Slot::ObjectSamples, samples),
    };
    plan.has_objects.then(|| Pass {
        feature: Feature::Objects,
        reads: vec![front(plan), vec![Input::Scene]],
        writes: vec![Some(Output::Texture(slot))],
        clear: Some(Clear::Zero),
        samples,
        area: Area::Target,
        ..Pass::fullscreen(UNDER_OBJECTS, Place::Present, None, with_front(plan, Program::new("under_objects")))
    })
}

/// Shows the objects over props.
pub(super) fn objects(plan: &Plan) -> Option<Pass> {
    plan.has_objects.then(|| Pass {
        feature: Feature::Objects,
        reads: vec![front(plan), vec![Input::Texture(Slot::Objects)]],
        writes: vec![Some(Output::Target)],
        area: Area::Target,
        ..Pass::fullscreen(OBJECTS, Place::Objects, None, with_front(plan, Program::new("objects")))
    })
}

/// Returns what `front.wgsl` reads.
fn front(plan: &Plan) -> Vec<Input> {
    let mut slots = vec![shown_after(plan.stages.len()), Slot::Color(RaySet::Pixels)];
    slots.extend(plan.has_owners().then_some(Slot::Owner(RaySet::Pixels)));
    slots.extend(plan.blends_front().then_some([Slot::Outline, Slot::Front]).into_iter().flatten());
    slots.into_iter().map(Input::Texture).collect()
}

/// Adds the definitions of `front.wgsl`.
fn with_front(plan: &Plan, program: Program) -> Program {
    program
        .define_all(space(plan.target.space))
        .define_if(plan.has_owners(), "OWNERS")
        .define_if(plan.blends_front(), "SMOOTH")
        .define_if(!plan.stages.is_empty(), "STAGED")
}

pub(super) fn plugin(render_app: &mut SubApp) {
    render_app.add_systems(Core3d, draw_objects.in_set(PlenOctreeRenderSystems::Objects));
}

/// Draws the objects over what `under_objects` wrote.
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
    let ops = Operations { load: LoadOp::Load, store: StoreOp::Store };
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
