//! Draws props, in the `Core3d` schedule.
//!
//! There is one module per pass. In the order of a frame:
//!
//! - `shadow` draws the props into the shadow maps of lights, before the main pass (feature `shadows`).
//! - `kept` finds what is still right of the previous frame, so that the passes up to `blend` need not run.
//! - `solid` finds the nearest solid part of any prop, in views where props overlap.
//! - `volume` draws the props into the view's layer.
//! - `refine` interpolates pixels where rays agree, and draws the others, in views that do not cast a ray for every pixel.
//! - `edges` finds how much of a pixel posterized props cover where they end.
//! - `lighting` finds how much of the scene's light is kept from props (feature `shadows`).
//! - `composite` blends the layer over the scene.
//! - `filter` flattens the colors.
//! - `label` replaces them by palette colors.
//! - `blend` blends the parts of the pixels where posterized props end.
//! - `present` writes the result, or that of custom stages, to the view's target.
//! - `depth` writes depth where props are solid.
//! - `prepass` writes their depth and motion into the textures of Bevy's prepass, for effects that read it.
//! - `transparent` draws transparent objects over props that are drawn after them.
//!
//! `solid`, `volume`, `refine` and `edges` run after the opaque main pass and the sky, and before objects that transmit light.
//! The other passes run right after them, or after all post-processing, depending on [`PropStage`].

mod attachment;
mod bind_group;
mod blend;
mod boxes;
mod composite;
mod depth;
mod edges;
mod extract;
mod filter;
mod fullscreen;
mod kept;
mod label;
mod lighting;
mod order;
mod pass;
mod prepass;
mod present;
mod rays;
mod refine;
#[cfg(feature = "shadows")]
mod shadow;
mod solid;
mod target;
mod transparent;
mod view;
mod volume;

pub use label::{LabelTextures, StageWrite};

use bevy::{
    core_pipeline::schedule::{Core3d, Core3dSystems},
    prelude::*,
    render::{ExtractSchedule, Render, RenderApp, RenderSystems},
};

use crate::{sets::PlenOctreeRenderSystems, stage::PropStage};

/// The names of the spans in Bevy's render diagnostics whose times add up to the time of drawing props.
pub const VOLUME_SPANS: &[&str] = &[
    volume::VOLUME_SPAN,
    volume::BATCHES_SPAN,
    solid::SOLID_SPAN,
    solid::SOLID_BATCHES_SPAN,
    refine::INTERPOLATE_SPAN,
    refine::GATHER_SPAN,
    kept::COMPARE_DEPTHS_SPAN,
];
/// The names of the spans in Bevy's render diagnostics whose times add up to the time of posterizing.
pub const POSTERIZE_SPANS: &[&str] = &[
    kept::COMPARE_COLORS_SPAN,
    edges::EDGES_SPAN,
    composite::COMPOSITE_SPAN,
    filter::FILTER_SPAN,
    label::LABEL_SPAN,
    blend::BLEND_SPAN,
    present::PRESENT_SPAN,
    depth::DEPTH_SPAN,
    prepass::PREPASS_SPAN,
    transparent::TRANSPARENT_SPAN,
];
/// The names of the spans in Bevy's render diagnostics whose times add up to the time of drawing props into shadow maps.
#[cfg(feature = "shadows")]
pub const SHADOW_SPANS: &[&str] = &[shadow::SHADOW_SPAN];
/// The names of the spans in Bevy's render diagnostics whose times add up to the time of lighting props.
#[cfg(feature = "shadows")]
pub const LIGHTING_SPANS: &[&str] = &[lighting::LIGHTING_SPAN];

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
            kept::plugin,
            solid::plugin,
            volume::plugin,
            refine::plugin,
            edges::plugin,
            composite::plugin,
            filter::plugin,
            label::plugin,
            blend::plugin,
            present::plugin,
            depth::plugin,
            prepass::plugin,
            transparent::plugin,
        ));
        app.add_plugins((
            lighting::plugin,
            #[cfg(feature = "shadows")]
            shadow::plugin,
        ));
    }
}

/// The steps of [`PlenOctreeRenderSystems::Volume`].
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum VolumeSteps {
    Compare,
    Solid,
    Volume,
}

/// The steps of [`PlenOctreeRenderSystems::Refine`].
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum RefineSteps {
    Interpolate,
    Solid,
    Volume,
    Gather,
}

/// The steps of [`PlenOctreeRenderSystems::Posterize`].
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum PosterizeSteps {
    Compare(PropStage),
    Composite(PropStage),
    Filter(PropStage),
    Label(PropStage),
    Blend(PropStage),
}

/// The passes from compositing to depth, at one place in the frame.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct PassesAt(PropStage);

/// All passes that run between the opaque and the transparent main pass.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct PassesInScene;

/// Orders the systems of the `Render` schedule.
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
            (RefineSteps::Interpolate, RefineSteps::Solid, RefineSteps::Volume, RefineSteps::Gather)
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
            order::order_last(schedule, PassesAt(PropStage::Display), Core3dSystems::PostProcess);
            order::order_after_opaque(schedule, PassesInScene);
        });
}
