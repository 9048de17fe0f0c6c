//! The upsample pass: enlarges the coarse layer to the size of the viewport.

mod pass;
mod pipeline;

pub use pass::UPSAMPLE_SPAN;
pub(super) use pipeline::UpsamplePipeline;

use bevy::{
    core_pipeline::schedule::Core3d,
    prelude::*,
    render::{Render, RenderApp, RenderStartup},
};

use super::{extract::VisibleProps, view::InitViews};
use crate::sets::PlenOctreeRenderSystems;

pub(super) fn plugin(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
        return;
    };
    render_app.world_mut().register_required_components::<VisibleProps, pass::UpsampleBindGroup>();
    render_app
        .add_systems(RenderStartup, pipeline::init.after(InitViews))
        .add_systems(Render, pass::prepare_bind_groups.in_set(PlenOctreeRenderSystems::PrepareBindGroups))
        .add_systems(Core3d, pass::upsample_pass.in_set(PlenOctreeRenderSystems::Upsample));
}
