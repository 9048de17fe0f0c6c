//! Blends the parts of the pixels where posterized props end: what the edges passes found, over what the label pass shows.
//!
//! The *blend* pass writes a texture of its own, because it reads what neighbors show. The *patch* pass then puts its
//! result in their midst. Both run only for pixels at which props end.

mod pass;
mod pipeline;

pub use pass::BLEND_SPAN;
pub(super) use pass::{BlendPass, BlendedTexture};

use bevy::{
    prelude::*,
    render::{GpuResourceAppExt, Render, RenderApp, RenderSystems, render_resource::SpecializedRenderPipelines},
};

use super::{
    PosterizeSteps,
    pass::{Pass, add_pass},
};
use crate::sets::PlenOctreeRenderSystems;

pub(super) fn plugin(app: &mut App) {
    if let Some(render_app) = app.get_sub_app_mut(RenderApp) {
        render_app.init_gpu_resource::<SpecializedRenderPipelines<pipeline::BlendPipeline>>().add_systems(
            Render,
            pass::prepare_textures.after(PlenOctreeRenderSystems::PrepareViews).in_set(RenderSystems::PrepareResources),
        );
    }
    let systems = Pass {
        init: pipeline::init.into_configs(),
        prepare_pipelines: pass::prepare_pipelines.into_configs(),
        prepare_bind_groups: pass::prepare_bind_groups.into_configs(),
        draw: pass::blend_pass,
    };
    add_pass::<pass::BlendPass, _, _, _>(app, PosterizeSteps::Blend, systems);
}
