//! The pipelines of the transparent pass.

use bevy::{
    prelude::*,
    render::render_resource::{
        BindGroupLayoutEntries, BlendState, RenderPipelineDescriptor, ShaderStages, SpecializedRenderPipeline,
        TextureFormat, TextureSampleType,
        binding_types::{texture_2d, texture_depth_2d},
    },
};

use crate::{
    gpu::Shaders,
    render::{
        fullscreen::{Fullscreen, target},
        view::ViewLayouts,
    },
};

/// Blends transparent objects over props.
#[derive(Resource)]
pub(super) struct TransparentPipeline(pub Fullscreen);

pub(super) fn init(mut commands: Commands, views: Res<ViewLayouts>, shaders: Res<Shaders>) {
    let textures = (texture_depth_2d(), texture_2d(TextureSampleType::Float { filterable: false }));
    let entries = BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, textures);
    let pass = Fullscreen::new("plenoctree_transparent", &shaders.transparent, &entries, &shaders, &views);
    commands.insert_resource(TransparentPipeline(pass));
}

impl SpecializedRenderPipeline for TransparentPipeline {
    /// The format of the view's target.
    type Key = TextureFormat;

    fn specialize(&self, format: TextureFormat) -> RenderPipelineDescriptor {
        self.0.pipeline(vec![], &[target(format, Some(BlendState::PREMULTIPLIED_ALPHA_BLENDING))])
    }
}
