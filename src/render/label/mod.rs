//! The label pass: assigns labels to the pixels that are posterized. See section 4 of the method, steps 1 and 3 to 5.
//!
//! The pass writes the view's target. For cameras with [`LabelStages`](crate::LabelStages), it writes textures instead,
//! which custom stages modify, and the present pass writes the target.

mod pass;
mod pipeline;
mod textures;

pub use pass::LABEL_SPAN;
pub(super) use pipeline::to_target;
pub use textures::{LabelTextures, StageWrite};

use bevy::{
    core_pipeline::schedule::Core3d,
    prelude::*,
    render::{
        GpuResourceAppExt, Render, RenderApp, RenderStartup, RenderSystems, render_resource::SpecializedRenderPipelines,
    },
};

use super::{PosterizeSteps, extract::VisibleProps, view::InitViews};
use crate::{sets::PlenOctreeRenderSystems, stage::PropStage};

pub(super) fn plugin(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
        return;
    };
    render_app.world_mut().register_required_components::<VisibleProps, pass::LabelPass>();
    render_app
        .init_gpu_resource::<SpecializedRenderPipelines<pipeline::LabelPipeline>>()
        .add_systems(RenderStartup, pipeline::init.after(InitViews))
        .add_systems(
            Render,
            (
                textures::prepare_textures
                    .after(PlenOctreeRenderSystems::PrepareViews)
                    .in_set(RenderSystems::PrepareResources),
                pass::prepare_pipelines.in_set(PlenOctreeRenderSystems::PreparePipelines),
                pass::prepare_bind_groups.in_set(PlenOctreeRenderSystems::PrepareBindGroups),
            ),
        )
        .add_systems(
            Core3d,
            (
                pass::label_pass.with_input(PropStage::Scene).in_set(PosterizeSteps::Label(PropStage::Scene)),
                pass::label_pass.with_input(PropStage::Display).in_set(PosterizeSteps::Label(PropStage::Display)),
            ),
        );
}
