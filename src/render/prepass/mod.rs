//! The prepass pass: writes the depth and the motion of solid props into the textures of Bevy's prepass, which temporal
//! antialiasing, motion blur and other effects read.

mod pass;
mod pipeline;

pub use pass::PREPASS_SPAN;

use bevy::{
    core_pipeline::schedule::Core3d,
    prelude::*,
    render::{GpuResourceAppExt, Render, RenderApp, RenderStartup, render_resource::SpecializedRenderPipelines},
};

use super::{extract::VisibleProps, steps::PassesAt, view::InitViews};
use crate::{sets::PlenOctreeRenderSystems, stage::PropStage};

pub(super) fn plugin(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
        return;
    };
    render_app.world_mut().register_required_components::<VisibleProps, pass::PrepassPass>();
    render_app
        .init_gpu_resource::<SpecializedRenderPipelines<pipeline::PrepassPipeline>>()
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
            pass::prepass_pass
                .after(PlenOctreeRenderSystems::Depth(PropStage::Scene))
                .in_set(PassesAt(PropStage::Scene)),
        );
}
