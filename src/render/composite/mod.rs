//! The composite pass: blends the layer over the scene. Posterization works on the result. Where nothing is posterized,
//! the label pass blends them itself.

mod pass;
mod pipeline;
mod textures;

pub use pass::COMPOSITE_SPAN;
pub(super) use textures::{COMPOSITE_FORMAT, CompositeTextures};

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
            .init_gpu_resource::<SpecializedRenderPipelines<pipeline::CompositePipeline>>()
            .add_systems(Render, textures::prepare_textures.in_set(PrepareTextures));
    }
    let systems = Pass {
        init: pipeline::init.into_configs(),
        prepare_pipelines: pass::prepare_pipelines.into_configs(),
        prepare_bind_groups: pass::prepare_bind_groups.into_configs(),
        draw: pass::composite_pass,
    };
    add_pass::<pass::CompositePass, _, _, _>(app, PosterizeSteps::Composite, systems);
}
