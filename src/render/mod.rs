//! Props on screen, in the `Core3d` schedule.
//!
//! One folder a pass, in the order of a frame: `volume` draws the props into the view's layer and `upsample` brings it to
//! the size of the viewport; `composite` blends it over the scene, `filter` flattens its colors, `label` posterizes it,
//! `present` writes what custom stages made of that, and `depth` writes where the props are solid. The first two run
//! between the opaque and the transparent main pass, and so do the others, or last of all post-processing:
//! [`PropStage`] says which.

mod attachment;
mod bind_group;
mod composite;
mod depth;
mod extract;
mod filter;
mod fullscreen;
mod label;
mod last;
mod present;
mod upsample;
mod view;
mod volume;

pub use label::{LabelTextures, StageWrite};

use bevy::{
    core_pipeline::{
        core_3d::{main_opaque_pass_3d, main_transparent_pass_3d},
        schedule::{Core3d, Core3dSystems},
    },
    prelude::*,
    render::{ExtractSchedule, Render, RenderApp, RenderSystems},
};

use crate::{sets::PlenOctreeRenderSystems, stage::PropStage};

/// Names of the spans in Bevy's render diagnostics whose times add up to that of drawing the props.
pub const VOLUME_SPANS: &[&str] = &[volume::VOLUME_SPAN, upsample::UPSAMPLE_SPAN];
/// Names of the spans in Bevy's render diagnostics whose times add up to that of posterizing.
pub const POSTERIZE_SPANS: &[&str] =
    &[composite::COMPOSITE_SPAN, filter::FILTER_SPAN, label::LABEL_SPAN, present::PRESENT_SPAN, depth::DEPTH_SPAN];

/// Draws every [`Prop`](crate::Prop).
pub(crate) struct RenderPropsPlugin;

impl Plugin for RenderPropsPlugin {
    fn build(&self, app: &mut App) {
        if let Some(render_app) = app.get_sub_app_mut(RenderApp) {
            render_app.init_resource::<extract::ExtractedProps>().add_systems(ExtractSchedule, extract::extract_props);
            order_render(render_app);
            order_passes(render_app, PropStage::Scene);
            order_passes(render_app, PropStage::Display);
            order_stages(render_app);
        }
        app.add_plugins((
            view::plugin,
            volume::plugin,
            upsample::plugin,
            composite::plugin,
            filter::plugin,
            label::plugin,
            present::plugin,
            depth::plugin,
        ));
    }
}

/// The steps of [`PlenOctreeRenderSystems::Posterize`].
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum PosterizeSteps {
    Composite(PropStage),
    Filter(PropStage),
    Label(PropStage),
}

/// All that is drawn at one place in the frame.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct PassesAt(PropStage);

/// The order of the `Render` schedule.
fn order_render(render_app: &mut SubApp) {
    render_app.configure_sets(
        Render,
        (
            (
                PlenOctreeRenderSystems::ChooseLevels,
                PlenOctreeRenderSystems::UploadLevels,
                PlenOctreeRenderSystems::PrepareViews,
                PlenOctreeRenderSystems::PreparePipelines,
            )
                .chain()
                .in_set(RenderSystems::PrepareResources),
            PlenOctreeRenderSystems::PrepareBindGroups.in_set(RenderSystems::PrepareBindGroups),
        ),
    );
}

/// The order of the passes at one place in the frame.
fn order_passes(render_app: &mut SubApp, stage: PropStage) {
    render_app.configure_sets(
        Core3d,
        (
            (PosterizeSteps::Composite(stage), PosterizeSteps::Filter(stage), PosterizeSteps::Label(stage))
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

/// The places in the frame.
fn order_stages(render_app: &mut SubApp) {
    render_app
        .configure_sets(
            Core3d,
            (PlenOctreeRenderSystems::Volume, PlenOctreeRenderSystems::Upsample, PassesAt(PropStage::Scene))
                .chain()
                .after(main_opaque_pass_3d)
                .before(main_transparent_pass_3d)
                .in_set(Core3dSystems::MainPass),
        )
        // Tonemapping, and effects of other plugins too, swap the view's textures: what is not ordered with them may draw
        // into the wrong one.
        .edit_schedule(Core3d, |schedule| {
            last::order_last(schedule, PassesAt(PropStage::Display), Core3dSystems::PostProcess);
        });
}
