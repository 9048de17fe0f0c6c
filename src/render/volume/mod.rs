//! The volume pass: draws every visible prop into the view's layer, back to front. See section 2 of the method.
//!
//! Where props overlap, the nearest solid depth of a pixel cuts them: first, all parts behind it are drawn, then the
//! prop that is solid there, then all parts in front of it.

mod pass;
mod pipeline;

pub(super) use pass::VolumePipelines;
pub use pass::{BATCHES_SPAN, VOLUME_SPAN};

use bevy::{
    core_pipeline::schedule::Core3d,
    prelude::*,
    render::{GpuResourceAppExt, Render, RenderApp, RenderStartup, render_resource::SpecializedRenderPipelines},
};

use super::{
    extract::VisibleProps,
    refine::RaysOf,
    steps::{RefineSteps, VolumeSteps},
    view::InitViews,
};
use crate::sets::PlenOctreeRenderSystems;

pub(super) fn plugin(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
        return;
    };
    render_app.world_mut().register_required_components::<VisibleProps, pass::VolumePipelines>();
    render_app
        .init_gpu_resource::<SpecializedRenderPipelines<pipeline::VolumePipeline>>()
        .add_systems(RenderStartup, pipeline::init.after(InitViews))
        .add_systems(Render, pass::prepare_pipelines.in_set(PlenOctreeRenderSystems::PreparePipelines))
        .add_systems(
            Core3d,
            (
                pass::volume_pass.with_input(RaysOf::Grid).in_set(VolumeSteps::Volume),
                pass::volume_pass.with_input(RaysOf::Batches).in_set(RefineSteps::Volume),
            ),
        );
}
