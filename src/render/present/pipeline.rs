//! The pipelines of the present pass.

use bevy::{
    prelude::*,
    render::render_resource::{
        BindGroupLayoutEntries, RenderPipelineDescriptor, ShaderStages, SpecializedRenderPipeline, TextureSampleType,
        binding_types::texture_2d,
    },
};

use crate::{
    gpu::Shaders,
    render::{fullscreen::Fullscreen, target::TargetKey, view::ViewLayouts},
};

/// Writes the colors from custom stages to the view's target.
#[derive(Resource)]
pub(super) struct PresentPipeline(pub Fullscreen);

pub(super) fn init(mut commands: Commands, views: Res<ViewLayouts>, shaders: Res<Shaders>) {
    let texture = texture_2d(TextureSampleType::Float { filterable: false });
    let entries = BindGroupLayoutEntries::single(ShaderStages::FRAGMENT, texture);
    let pass = Fullscreen::new("plenoctree_present", &shaders.present, &entries, &shaders, &views);
    commands.insert_resource(PresentPipeline(pass));
}

impl SpecializedRenderPipeline for PresentPipeline {
    type Key = TargetKey;

    fn specialize(&self, target: TargetKey) -> RenderPipelineDescriptor {
        target.pipeline(&self.0)
    }
}
