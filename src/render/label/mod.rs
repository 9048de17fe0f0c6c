//! The label pass: assigns labels to the pixels that are posterized. See section 4 of the method, steps 1 and 3 to 5.
//!
//! The pass writes textures, in which the blend pass smooths edges and which custom stages modify. The present pass
//! writes the view's target.

mod pass;
mod pipeline;
mod textures;

pub use pass::LABEL_SPAN;
pub use textures::{LabelTextures, StageWrite};
pub(super) use textures::{SHOWN_FORMAT, ShownTexture};

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
            .init_gpu_resource::<SpecializedRenderPipelines<pipeline::LabelPipeline>>()
            .add_systems(Render, textures::prepare_textures.in_set(PrepareTextures));
    }
    let systems = Pass {
        init: pipeline::init.into_configs(),
        prepare_pipelines: pass::prepare_pipelines.into_configs(),
        prepare_bind_groups: pass::prepare_bind_groups.into_configs(),
        draw: pass::label_pass,
    };
    add_pass::<pass::LabelPass, _, _, _>(app, PosterizeSteps::Label, systems);
}
