//! The pipelines of the depth pass.

use bevy::{
    core_pipeline::core_3d::CORE_3D_DEPTH_FORMAT,
    prelude::*,
    render::render_resource::{
        BindGroupLayoutEntries, CompareFunction, RenderPipelineDescriptor, ShaderStages, SpecializedRenderPipeline,
        binding_types::texture_depth_2d,
    },
};

use crate::{
    gpu::Shaders,
    render::{attachment::depth_test, fullscreen::Fullscreen, view::ViewLayouts},
};

/// Writes the depth of props.
#[derive(Resource)]
pub(super) struct DepthPipeline(pub Fullscreen);

pub(super) fn init(mut commands: Commands, views: Res<ViewLayouts>, shaders: Res<Shaders>) {
    let entries = BindGroupLayoutEntries::single(ShaderStages::FRAGMENT, texture_depth_2d());
    let pass = Fullscreen::new("plenoctree_depth", &shaders.depth, &entries, &shaders, &views);
    commands.insert_resource(DepthPipeline(pass));
}

impl SpecializedRenderPipeline for DepthPipeline {
    /// The number of samples per pixel.
    type Key = u32;

    fn specialize(&self, samples: u32) -> RenderPipelineDescriptor {
        let mut descriptor = self.0.pipeline(vec![], &[]);
        descriptor.multisample.count = samples;
        descriptor.depth_stencil = Some(depth_test(CORE_3D_DEPTH_FORMAT, true, CompareFunction::Greater));
        descriptor
    }
}
