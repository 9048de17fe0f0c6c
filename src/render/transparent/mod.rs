//! The transparent pass: draws transparent objects again, over props that are drawn at [`PropStage::Display`].
//!
//! Bevy draws transparent objects before tonemapping, so that the props cover them. Where a prop is solid, this pass
//! draws those in front of it once more, into a separate texture, and blends them over the prop. It runs only for
//! cameras that have both.

mod pass;
mod pipeline;
mod textures;

pub use pass::TRANSPARENT_SPAN;

use bevy::{
    core_pipeline::schedule::Core3d,
    prelude::*,
    render::{GpuResourceAppExt, Render, RenderApp, RenderStartup, render_resource::SpecializedRenderPipelines},
};

use super::{
    extract::VisibleProps,
    steps::{PassesAt, PrepareTextures},
    view::InitViews,
};
use crate::{sets::PlenOctreeRenderSystems, stage::PropStage};

pub(super) fn plugin(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
        return;
    };
    render_app.world_mut().register_required_components::<VisibleProps, pass::TransparentPass>();
    render_app
        .init_gpu_resource::<SpecializedRenderPipelines<pipeline::TransparentPipeline>>()
        .add_systems(RenderStartup, pipeline::init.after(InitViews))
        .add_systems(
            Render,
            (
                textures::prepare_textures.in_set(PrepareTextures),
                pass::prepare_pipelines.in_set(PlenOctreeRenderSystems::PreparePipelines),
                pass::prepare_bind_groups.in_set(PlenOctreeRenderSystems::PrepareBindGroups),
            ),
        )
        .add_systems(
            Core3d,
            pass::transparent_pass
                .after(PlenOctreeRenderSystems::Depth(PropStage::Display))
                .in_set(PassesAt(PropStage::Display)),
        );
}
