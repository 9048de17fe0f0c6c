//! Draws transparent objects again, over props that are drawn at [`PropPlacement::Display`].
//!
//! Bevy draws transparent objects before tonemapping, when these props are not yet there. Blending depends on what is
//! behind, so where props are, they are drawn later: *hide_objects* changes the scene's depth there, and
//! *restore_depth* restores it after Bevy's phase. Once the props are shown, *under_objects* copies the target to a
//! separate texture, Bevy's phase draws over it, and *objects* shows the result where props are. This happens only for
//! cameras that have both.

use bevy::{
    core_pipeline::{
        core_3d::{Transparent3d, main_transparent_pass_3d},
        schedule::{Core3d, Core3dSystems},
    },
    prelude::*,
    render::{
        diagnostic::RecordDiagnostics,
        render_phase::ViewSortedRenderPhases,
        render_resource::*,
        renderer::{RenderContext, ViewQuery},
        view::{ExtractedView, ViewDepthTexture},
    },
};

use crate::{
    camera::PropPlacement,
    render::{
        frame::{Clear, FirstGroup, Pass, Place, Program, PropView, Slot, run},
        plan::{Feature, Plan},
    },
    sets::PlenOctreeRenderSystems,
};

pub(super) const HIDE_OBJECTS: &str = "plenoctree_hide_objects";
pub(super) const RESTORE_DEPTH: &str = "plenoctree_restore_depth";
pub(super) const OBJECTS: &str = "plenoctree_objects";
pub(super) const UNDER_OBJECTS: &str = "plenoctree_under_objects";

/// Hides objects where props are, and restores the depth of the scene.
pub(super) fn hide_objects(plan: &Plan) -> Vec<Pass> {
    let pass = |name, place, program: Program, reads| {
        let program = program.define_if(plan.smooths, "SMOOTH").depth_test(CompareFunction::Always, true);
        Pass {
            feature: Feature::Objects,
            reads,
            depth: Some(Slot::TargetDepth),
            samples: plan.samples,
            ..Pass::fullscreen(name, place, None, vec![program])
        }
    };
    if !plan.has_objects {
        return vec![];
    }
    let restore = pass(RESTORE_DEPTH, Place::Restore, Program::new("restore_depth"), vec![prop_pixels(plan)]);
    vec![
        pass(HIDE_OBJECTS, Place::Hide, Program::new("hide_objects"), vec![prop_pixels(plan), vec![Slot::DEPTH]]),
        Pass { group: FirstGroup::SceneDepth(plan.samples), ..restore },
    ]
}

/// Writes what objects are blended over.
pub(super) fn under_objects(plan: &Plan) -> Option<Pass> {
    let has_samples = plan.samples > 1;
    let is_of_floats = has_samples && plan.target.format == TextureFormat::Rgba16Float;
    let program = Program::new("under_objects").define_if(is_of_floats, "FLOATS");
    let slot = if has_samples { Slot::ObjectSamples } else { Slot::Objects };
    plan.has_objects.then(|| Pass {
        feature: Feature::Objects,
        group: FirstGroup::with_depth_if(has_samples, plan.samples),
        reads: vec![vec![Slot::Scene, Slot::DEPTH]],
        writes: vec![slot],
        clear: Some(Clear::Zero),
        samples: plan.samples,
        ..Pass::fullscreen(UNDER_OBJECTS, Place::Present, None, vec![program])
    })
}

/// Shows the objects over props.
pub(super) fn objects(plan: &Plan) -> Option<Pass> {
    let program = Program::new("objects").define_if(plan.smooths, "SMOOTH");
    plan.has_objects.then(|| Pass {
        feature: Feature::Objects,
        reads: vec![prop_pixels(plan), vec![Slot::Objects]],
        writes: vec![Slot::Target],
        ..Pass::fullscreen(OBJECTS, Place::Objects, None, vec![program])
    })
}

/// Returns what `prop_pixels.wgsl` reads, the second texture if `SMOOTH` is defined.
fn prop_pixels(plan: &Plan) -> Vec<Slot> {
    [Slot::COLOR].into_iter().chain(plan.smooths.then_some(Slot::Outline)).collect()
}

/// Adds the systems that run before and after the transparent main pass, and after *under_objects*.
pub(super) fn plugin(render_app: &mut SubApp) {
    let display = PropPlacement::Display;
    let hide = (save_depth, run.with_input((Place::Hide, display))).chain().after(PlenOctreeRenderSystems::Layer);
    let restore = run.with_input((Place::Restore, display));
    #[cfg(feature = "shadows")]
    let hide = hide.after(bevy::pbr::main_transmissive_pass_3d);
    render_app.add_systems(Core3d, draw_objects.in_set(PlenOctreeRenderSystems::Objects)).add_systems(
        Core3d,
        (hide.before(main_transparent_pass_3d), restore.after(main_transparent_pass_3d))
            .in_set(Core3dSystems::MainPass),
    );
}

/// Saves the depth of the scene before *hide_objects* changes it.
fn save_depth(view: ViewQuery<(&ViewDepthTexture, &PropView)>, mut ctx: RenderContext) {
    let (depth, view) = view.into_inner();
    let hides = view.passes.iter().any(|pass| pass.place == Place::Hide);
    let saved = view.textures.get(Slot::SceneDepth).filter(|_| hides).map(|saved| saved.texture());
    if let Some(saved) = saved.filter(|saved| saved.size() == depth.texture.size()) {
        let (from, to) = (depth.texture.as_image_copy(), saved.as_image_copy());
        ctx.command_encoder().copy_texture_to_texture(from, to, saved.size());
    }
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
    let has_objects = view.passes.iter().any(|pass| pass.place == Place::Objects);
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
