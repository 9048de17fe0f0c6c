//! The depth pass: writes the depth of props where they are solid, for everything that is drawn later.

mod pass;
mod pipeline;

pub use pass::DEPTH_SPAN;

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
    render_app.world_mut().register_required_components::<VisibleProps, pass::DepthPass>();
    render_app
        .init_gpu_resource::<SpecializedRenderPipelines<pipeline::DepthPipeline>>()
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
                pass::depth_pass.with_input(PropStage::Scene).in_set(PlenOctreeRenderSystems::Depth(PropStage::Scene)),
                pass::depth_pass
                    .with_input(PropStage::Display)
                    .in_set(PlenOctreeRenderSystems::Depth(PropStage::Display)),
            ),
        );
}
