//! The bilateral filter, which flattens colors before labels are assigned. See section 4 of the method, step 2.

mod pass;
mod pipeline;

pub use pass::FILTER_SPAN;

use bevy::{
    core_pipeline::schedule::Core3d,
    prelude::*,
    render::{Render, RenderApp, RenderStartup},
};

use super::{PosterizeSteps, extract::VisibleProps, view::InitViews};
use crate::{sets::PlenOctreeRenderSystems, stage::PropStage};

pub(super) fn plugin(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
        return;
    };
    render_app.world_mut().register_required_components::<VisibleProps, pass::FilterBindGroups>();
    render_app
        .add_systems(RenderStartup, pipeline::init.after(InitViews))
        .add_systems(
            Render,
            (
                pass::require_pipelines.in_set(PlenOctreeRenderSystems::PreparePipelines),
                pass::prepare_bind_groups.in_set(PlenOctreeRenderSystems::PrepareBindGroups),
            ),
        )
        .add_systems(
            Core3d,
            (
                pass::filter_pass.with_input(PropStage::Scene).in_set(PosterizeSteps::Filter(PropStage::Scene)),
                pass::filter_pass.with_input(PropStage::Display).in_set(PosterizeSteps::Filter(PropStage::Display)),
            ),
        );
}
