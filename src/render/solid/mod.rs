//! The solid pass: finds, for every pixel, the prop that is solid nearest to the camera, and where.
//!
//! Where others show through that prop, a second round finds the nearest one that is opaque.
//!
//! The volume pass cuts all other props there, so that a solid part hides what is behind it and shows what is in front
//! of it, regardless of the order in which props are drawn. The pass runs in views in which the boxes of props overlap,
//! and marches only through those props.

mod pass;
mod pipeline;
mod textures;

pub(super) use pass::SolidPipelines;
pub use pass::{SOLID_BATCHES_SPAN, SOLID_SPAN};
pub(super) use textures::{SOLID_FORMAT, SolidBindGroups, SolidLayouts, SolidTextures};

use bevy::{
    core_pipeline::schedule::Core3d,
    prelude::*,
    render::{GpuResourceAppExt, Render, RenderApp, RenderStartup, render_resource::SpecializedRenderPipelines},
};

use super::{
    extract::VisibleProps,
    refine::RaysOf,
    steps::{PrepareTextures, RefineSteps, VolumeSteps},
    view::InitViews,
};
use crate::sets::PlenOctreeRenderSystems;

pub(super) fn plugin(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
        return;
    };
    render_app.world_mut().register_required_components::<VisibleProps, pass::SolidPipelines>();
    render_app.world_mut().register_required_components::<VisibleProps, textures::SolidBindGroups>();
    render_app
        .init_gpu_resource::<SpecializedRenderPipelines<pipeline::SolidPipeline>>()
        .init_resource::<SolidLayouts>()
        .add_systems(RenderStartup, pipeline::init.after(InitViews))
        .add_systems(
            Render,
            (
                textures::prepare_textures.in_set(PrepareTextures),
                pass::prepare_pipelines.in_set(PlenOctreeRenderSystems::PreparePipelines),
                textures::prepare_bind_groups.in_set(PlenOctreeRenderSystems::PrepareBindGroups),
            ),
        )
        .add_systems(
            Core3d,
            (
                pass::solid_pass.with_input(RaysOf::Grid).in_set(VolumeSteps::Solid),
                pass::solid_pass.with_input(RaysOf::Batches).in_set(RefineSteps::Solid),
            ),
        );
}
