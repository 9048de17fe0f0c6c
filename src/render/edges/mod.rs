//! Finds how much of each edge pixel a posterized prop covers, so that the blend pass can blend it with what is behind.
//! This is not part of the method, whose edges are hard.
//!
//! The *outline* pass finds the pixels at the edges of props, and the owners that may cover parts of them. The
//! *coverage* pass then draws a rectangle for each prop and marches several rays through those pixels, and no others.
//!
//! Nothing here runs or is compiled in views in which the edges of all props are hard.

mod coverage;
mod outline;
mod pass;
mod textures;

pub use pass::EDGES_SPAN;
pub(super) use pass::EdgesPass;
pub(super) use textures::{EdgeTextures, mask_test};

use bevy::{
    core_pipeline::schedule::Core3d,
    prelude::*,
    render::{GpuResourceAppExt, Render, RenderApp, RenderStartup, render_resource::SpecializedRenderPipelines},
};

use super::{extract::VisibleProps, steps::PrepareTextures, view::InitViews};
use crate::sets::PlenOctreeRenderSystems;

pub(super) fn plugin(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
        return;
    };
    render_app.world_mut().register_required_components::<VisibleProps, pass::EdgesPass>();
    render_app
        .init_gpu_resource::<SpecializedRenderPipelines<coverage::CoveragePipeline>>()
        .add_systems(RenderStartup, (outline::init, coverage::init).after(InitViews))
        .add_systems(
            Render,
            (
                textures::prepare_textures.in_set(PrepareTextures),
                pass::prepare_pipelines.in_set(PlenOctreeRenderSystems::PreparePipelines),
                pass::prepare_bind_groups.in_set(PlenOctreeRenderSystems::PrepareBindGroups),
            ),
        )
        .add_systems(Core3d, pass::edges_pass.in_set(PlenOctreeRenderSystems::Edges));
}
