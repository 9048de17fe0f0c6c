//! Rays where the picture needs them, for views that do not cast a ray for every pixel.
//!
//! The volume pass first draws a *grid* of rays, one for every `PropQuality::spacing` pixels along each axis. The
//! *check* pass compares the rays around each *gap* between them, and collects the gaps where they differ in *batches*.
//! The pixels of these are marched in textures of their own, side by side, because neither graphics cards nor software
//! rasterizers gain anything by leaving out single pixels. The *fill* pass takes the results to their places in the
//! layer, and interpolates the rays of the grid across all other gaps.

mod batches;
mod check;
mod fill;
mod pass;
mod rays;

pub(super) use batches::Batches;
pub(super) use pass::RefinePass;
pub use pass::{CHECK_SPAN, FILL_SPAN};
pub(super) use rays::{BATCH, RaysOf, batch_side, batches, batches_size};

use bevy::{
    core_pipeline::schedule::Core3d,
    prelude::*,
    render::{GpuResourceAppExt, Render, RenderApp, RenderStartup, render_resource::SpecializedRenderPipelines},
};

use super::{
    extract::VisibleProps,
    steps::{PrepareTextures, RefineSteps},
    view::{BindViews, InitViews},
};
use crate::sets::PlenOctreeRenderSystems;

pub(super) fn plugin(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
        return;
    };
    render_app.world_mut().register_required_components::<VisibleProps, Batches>();
    render_app.world_mut().register_required_components::<VisibleProps, RefinePass>();
    render_app
        .init_gpu_resource::<SpecializedRenderPipelines<check::CheckPipeline>>()
        .init_gpu_resource::<SpecializedRenderPipelines<fill::FillPipeline>>()
        .add_systems(RenderStartup, (check::init, fill::init).after(InitViews))
        .add_systems(
            Render,
            (
                batches::prepare.in_set(PrepareTextures),
                pass::prepare_pipelines.in_set(PlenOctreeRenderSystems::PreparePipelines),
                pass::prepare_bind_groups.after(BindViews).in_set(PlenOctreeRenderSystems::PrepareBindGroups),
            ),
        )
        .add_systems(Core3d, (pass::check_pass.in_set(RefineSteps::Check), pass::fill_pass.in_set(RefineSteps::Fill)));
}
