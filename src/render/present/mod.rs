//! The present pass: writes what the label pass or custom stages show to the view's target.

mod pass;
mod pipeline;

pub use pass::PRESENT_SPAN;

use bevy::{
    prelude::*,
    render::{GpuResourceAppExt, RenderApp, render_resource::SpecializedRenderPipelines},
};

use super::pass::{Pass, add_pass};
use crate::sets::PlenOctreeRenderSystems;

pub(super) fn plugin(app: &mut App) {
    if let Some(render_app) = app.get_sub_app_mut(RenderApp) {
        render_app.init_gpu_resource::<SpecializedRenderPipelines<pipeline::PresentPipeline>>();
    }
    let systems = Pass {
        init: pipeline::init.into_configs(),
        prepare_pipelines: pass::prepare_pipelines.into_configs(),
        prepare_bind_groups: pass::prepare_bind_groups.into_configs(),
        draw: pass::present_pass,
    };
    add_pass::<pass::PresentPass, _, _, _>(app, PlenOctreeRenderSystems::Present, systems);
}
