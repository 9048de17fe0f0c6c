//! The pipelines of the present pass.

use bevy::{
    camera::CompositingSpace,
    prelude::*,
    render::render_resource::{
        BindGroupLayoutEntries, RenderPipelineDescriptor, ShaderStages, SpecializedRenderPipeline, TextureFormat,
        TextureSampleType, binding_types::texture_2d,
    },
};

use crate::{
    gpu::Shaders,
    render::{
        fullscreen::{Fullscreen, target_definitions},
        label::to_target,
        view::ViewLayouts,
    },
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

/// The properties of the view's target that the pipeline depends on.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct PresentKey {
    pub format: TextureFormat,
    pub samples: u32,
    pub space: Option<CompositingSpace>,
}

impl SpecializedRenderPipeline for PresentPipeline {
    type Key = PresentKey;

    fn specialize(&self, PresentKey { format, samples, space }: PresentKey) -> RenderPipelineDescriptor {
        let mut descriptor = self.0.pipeline(target_definitions(space), &[to_target(format)]);
        descriptor.multisample.count = samples;
        descriptor
    }
}
