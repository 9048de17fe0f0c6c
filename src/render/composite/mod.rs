//! The composite pass: blends the layer over the scene. Posterization works on the result.

mod pass;
mod pipeline;

pub use pass::COMPOSITE_SPAN;

use bevy::{
    core_pipeline::schedule::Core3d,
    prelude::*,
    render::{GpuResourceAppExt, Render, RenderApp, RenderStartup, render_resource::SpecializedRenderPipelines},
};

use super::{PosterizeSteps, extract::VisibleProps, view::InitViews};
use crate::{sets::PlenOctreeRenderSystems, stage::PropStage};

pub(super) fn plugin(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
        return;
    };
    render_app.world_mut().register_required_components::<VisibleProps, pass::CompositePass>();
    render_app
        .init_gpu_resource::<SpecializedRenderPipelines<pipeline::CompositePipeline>>()
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
                pass::composite_pass.with_input(PropStage::Scene).in_set(PosterizeSteps::Composite(PropStage::Scene)),
                pass::composite_pass
                    .with_input(PropStage::Display)
                    .in_set(PosterizeSteps::Composite(PropStage::Display)),
            ),
        );
}
