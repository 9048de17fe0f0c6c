//! The present pass: writes the output of custom stages to the view's target. Does not run in views without custom
//! stages.

mod pass;
mod pipeline;

pub use pass::PRESENT_SPAN;

use bevy::{
    core_pipeline::schedule::Core3d,
    prelude::*,
    render::{GpuResourceAppExt, Render, RenderApp, RenderStartup, render_resource::SpecializedRenderPipelines},
};

use super::{extract::VisibleProps, view::InitViews};
use crate::{sets::PlenOctreeRenderSystems, stage::PropStage};

pub(super) fn plugin(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
        return;
    };
    render_app.world_mut().register_required_components::<VisibleProps, pass::PresentPass>();
    render_app
        .init_gpu_resource::<SpecializedRenderPipelines<pipeline::PresentPipeline>>()
        .add_systems(RenderStartup, pipeline::init.after(InitViews))
        .add_systems(
            Render,
            (
                pass::prepare_pipelines.in_set(PlenOctreeRenderSystems::PreparePipelines),
                pass::prepare_bind_groups.in_set(PlenOctreeRenderSystems::PrepareBindGroups),
            ),
        )
        .add_systems(
            Core3d,
            (
                pass::present_pass
                    .with_input(PropStage::Scene)
                    .in_set(PlenOctreeRenderSystems::Present(PropStage::Scene)),
                pass::present_pass
                    .with_input(PropStage::Display)
                    .in_set(PlenOctreeRenderSystems::Present(PropStage::Display)),
            ),
        );
}
