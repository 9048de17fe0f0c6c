//! The steps of a frame, and their order.

use bevy::{
    core_pipeline::schedule::{Core3d, Core3dSystems},
    prelude::*,
    render::{Render, RenderSystems},
};

use super::order::{order_after_opaque, order_last};
use crate::{sets::PlenOctreeRenderSystems, stage::PropStage};

/// Orders all systems of the plugin in the render world.
pub(super) fn order(render_app: &mut SubApp) {
    order_render(render_app);
    order_passes(render_app, PropStage::Scene);
    order_passes(render_app, PropStage::Display);
    order_stages(render_app);
}

/// Creates the textures of passes, once it is known what each view draws.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct PrepareTextures;

/// The steps of [`PlenOctreeRenderSystems::Volume`].
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum VolumeSteps {
    Compare,
    Solid,
    Volume,
}

/// The steps of [`PlenOctreeRenderSystems::Refine`].
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum RefineSteps {
    Check,
    Solid,
    Volume,
    Fill,
}

/// The steps of [`PlenOctreeRenderSystems::Posterize`].
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum PosterizeSteps {
    Compare(PropStage),
    Composite(PropStage),
    Filter(PropStage),
    Label(PropStage),
    Blend(PropStage),
}

/// The passes from compositing to depth, at one place in the frame.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct PassesAt(pub PropStage);

/// All passes that run between the opaque and the transparent main pass.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct PassesInScene;

/// Orders the systems of the `Render` schedule.
fn order_render(render_app: &mut SubApp) {
    render_app.configure_sets(
        Render,
        (
            (
                PlenOctreeRenderSystems::ChooseLevels,
                PlenOctreeRenderSystems::UploadLevels,
                PlenOctreeRenderSystems::PrepareViews,
                PrepareTextures,
                PlenOctreeRenderSystems::PreparePipelines,
            )
                .chain()
                .in_set(RenderSystems::PrepareResources),
            PlenOctreeRenderSystems::PrepareBindGroups.in_set(RenderSystems::PrepareBindGroups),
        ),
    );
}

/// Orders the passes at one place in the frame.
fn order_passes(render_app: &mut SubApp, stage: PropStage) {
    render_app.configure_sets(
        Core3d,
        (
            (
                PosterizeSteps::Compare(stage),
                PosterizeSteps::Composite(stage),
                PosterizeSteps::Filter(stage),
                PosterizeSteps::Label(stage),
                PosterizeSteps::Blend(stage),
            )
                .chain()
                .in_set(PlenOctreeRenderSystems::Posterize(stage)),
            (
                PlenOctreeRenderSystems::Posterize(stage),
                PlenOctreeRenderSystems::LabelStages(stage),
                PlenOctreeRenderSystems::Present(stage),
                PlenOctreeRenderSystems::Depth(stage),
            )
                .chain()
                .in_set(PassesAt(stage)),
        ),
    );
}

/// Orders the passes within the frame.
fn order_stages(render_app: &mut SubApp) {
    render_app
        .configure_sets(
            Core3d,
            (VolumeSteps::Compare, VolumeSteps::Solid, VolumeSteps::Volume)
                .chain()
                .in_set(PlenOctreeRenderSystems::Volume),
        )
        .configure_sets(
            Core3d,
            (RefineSteps::Check, RefineSteps::Solid, RefineSteps::Volume, RefineSteps::Fill)
                .chain()
                .in_set(PlenOctreeRenderSystems::Refine),
        )
        .configure_sets(
            Core3d,
            (
                PlenOctreeRenderSystems::Volume,
                PlenOctreeRenderSystems::Refine,
                PlenOctreeRenderSystems::Edges,
                PassesAt(PropStage::Scene),
            )
                .chain()
                .in_set(PassesInScene),
        )
        // Tonemapping and effects of other plugins swap the view's textures. A pass that is not ordered relative to
        // them may draw to the wrong texture.
        .edit_schedule(Core3d, |schedule| {
            order_last(schedule, PassesAt(PropStage::Display), Core3dSystems::PostProcess);
            order_after_opaque(schedule, PassesInScene);
        });
}
