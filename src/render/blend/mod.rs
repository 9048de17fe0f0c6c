//! Smooths the edges of posterized props: blends what the edges passes found over what the label pass shows.
//!
//! The *blend* pass writes a separate texture, because it reads what neighbors show. The *patch* pass then copies its
//! result back. Both run only for pixels at the edges of props.

mod pass;
mod pipeline;

pub use pass::BLEND_SPAN;
pub(super) use pass::{BlendPass, BlendedTexture};

use bevy::{
    prelude::*,
    render::{GpuResourceAppExt, Render, RenderApp, render_resource::SpecializedRenderPipelines},
};

use super::{
    pass::{Pass, add_pass},
    steps::{PosterizeSteps, PrepareTextures},
};

pub(super) fn plugin(app: &mut App) {
    if let Some(render_app) = app.get_sub_app_mut(RenderApp) {
        render_app
            .init_gpu_resource::<SpecializedRenderPipelines<pipeline::BlendPipeline>>()
            .add_systems(Render, pass::prepare_textures.in_set(PrepareTextures));
    }
    let systems = Pass {
        init: pipeline::init.into_configs(),
        prepare_pipelines: pass::prepare_pipelines.into_configs(),
        prepare_bind_groups: pass::prepare_bind_groups.into_configs(),
        draw: pass::blend_pass,
    };
    add_pass::<pass::BlendPass, _, _, _>(app, PosterizeSteps::Blend, systems);
}
