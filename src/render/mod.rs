//! Draws props, in the `Core3d` schedule.
//!
//! In every frame, each view goes the same way:
//!
//! 1. `extract` copies props and cameras from the main world.
//! 2. `prepare` runs the next two steps. If a pipeline is not ready, it runs them again, without what needs it. Then it
//!    writes `uniforms`.
//! 3. `plan` decides everything: which props are drawn at which levels, on which pixels, and with what.
//! 4. `passes` lists the passes that follow from the plan, in the order in which they run. Each is a row of data: its
//!    shader, what it reads and writes, and when it runs.
//! 5. `frame` executes the passes. It owns the view's textures, creates pipelines and bind groups, and keeps results
//!    that are still valid.
//!
//! `shadow` draws the props into the shadow maps of lights, before the main pass (feature `shadows`).

#![cfg_attr(not(feature = "shadows"), allow(dead_code, reason = "lights and fog need it"))]

mod colors;
mod extract;
mod frame;
mod order;
mod passes;
mod plan;
mod prepare;
mod rays;
#[cfg(feature = "shadows")]
mod shades;
#[cfg(feature = "shadows")]
mod shadow;
mod uniforms;

#[cfg(feature = "headless")]
pub(crate) use frame::PropView;
#[cfg(feature = "shadows")]
pub use passes::LIGHTING_SPANS;
pub use passes::{POSTERIZE_SPANS, VOLUME_SPANS};

use bevy::{
    core_pipeline::{
        core_3d::{main_opaque_pass_3d, main_transparent_pass_3d},
        schedule::{Core3d, Core3dSystems},
    },
    prelude::*,
    render::{ExtractSchedule, Render, RenderApp, RenderSystems},
};

use self::{
    frame::{Place, run},
    order::OrderPasses,
};
use crate::{camera::PropPlacement, sets::PlenOctreeRenderSystems};

/// The names of the spans in Bevy's render diagnostics whose times add up to the time of drawing props into shadow
/// maps.
#[cfg(feature = "shadows")]
pub const SHADOW_SPANS: &[&str] = &[shadow::SHADOW_SPAN];

/// Draws every [`Prop`](crate::Prop).
pub(crate) struct RenderPropsPlugin;

impl Plugin for RenderPropsPlugin {
    fn build(&self, app: &mut App) {
        if let Some(render_app) = app.get_sub_app_mut(RenderApp) {
            render_app
                .init_resource::<extract::ExtractedProps>()
                .add_systems(ExtractSchedule, (extract::extract_props, extract::extract_views).chain());
            prepare::plugin(render_app);
            passes::plugin(render_app);
            add_passes(render_app);
        }
        #[cfg(feature = "shadows")]
        app.add_plugins(shadow::plugin);
    }
}

/// The passes that show props, at one place in the frame.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct PassesAt(PropPlacement);

/// All passes that run between the opaque and the transparent main pass.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct PassesInScene;

/// Adds the systems that run passes, and orders all systems of the plugin in the render world.
fn add_passes(render_app: &mut SubApp) {
    use PlenOctreeRenderSystems::*;
    render_app
        .configure_sets(Render, (ChooseLevels, UploadLevels, PlanViews).chain().in_set(RenderSystems::PrepareResources))
        .add_systems(Core3d, run.with_input((Place::Layer, PropPlacement::Scene)).in_set(Layer))
        .configure_sets(Core3d, (Layer, PassesAt(PropPlacement::Scene)).chain().in_set(PassesInScene));
    for placement in [PropPlacement::Scene, PropPlacement::Display] {
        render_app
            .configure_sets(Core3d, (Posterize(placement), Present(placement)).chain().in_set(PassesAt(placement)))
            .add_systems(
                Core3d,
                (
                    run.with_input((Place::Posterize, placement)).in_set(Posterize(placement)),
                    run.with_input((Place::Present, placement)).in_set(Present(placement)),
                ),
            );
    }
    let display = PropPlacement::Display;
    render_app
        .configure_sets(
            Core3d,
            (
                Objects.after(Present(display)).in_set(PassesAt(display)),
                PassesAt(display).in_set(Core3dSystems::PostProcess),
                PassesInScene
                    .after(main_opaque_pass_3d)
                    .before(main_transparent_pass_3d)
                    .in_set(Core3dSystems::MainPass),
            ),
        )
        .add_systems(Core3d, run.with_input((Place::Objects, display)).after(passes::draw_objects).in_set(Objects))
        .edit_schedule(Core3d, |schedule| {
            let order = OrderPasses { scene: PassesInScene.intern(), display: PassesAt(display).intern() };
            schedule.add_build_pass(order);
        });
}
