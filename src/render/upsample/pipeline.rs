//! The pipelines of the upsample pass.

use bevy::{
    prelude::*,
    render::render_resource::{
        BindGroupLayoutEntries, CachedRenderPipelineId, CompareFunction, PipelineCache, ShaderStages,
        TextureSampleType,
        binding_types::{texture_2d, texture_depth_2d},
    },
};

use crate::{
    gpu::Shaders,
    render::{
        attachment::depth_test,
        fullscreen::{Fullscreen, target},
        view::{DEPTH_FORMAT, LAYER_FORMAT, OWNER_FORMAT, ViewLayouts},
    },
};

#[derive(Resource)]
pub(super) struct UpsamplePipeline {
    pub shared: Fullscreen,
    /// For a single-sampled scene, and for a multisampled one.
    ids: [CachedRenderPipelineId; 2],
}

impl UpsamplePipeline {
    /// Returns the pipeline for a scene with this number of samples per pixel.
    pub fn id(&self, msaa: &Msaa) -> CachedRenderPipelineId {
        self.ids[usize::from(msaa.samples() > 1)]
    }
}

pub(super) fn init(mut commands: Commands, views: Res<ViewLayouts>, shaders: Res<Shaders>, cache: Res<PipelineCache>) {
    let texture = || texture_2d(TextureSampleType::Float { filterable: false });
    let entries =
        BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, (texture(), texture(), texture_depth_2d()));
    let shared = Fullscreen::new("plenoctree_upsample", &shaders.upsample, &entries, &shaders, &views);
    let ids = [(0, None), (1, Some("MULTISAMPLED"))].map(|(samples, definition)| {
        let definitions = definition.into_iter().map(Into::into).collect();
        let mut descriptor = shared.pipeline(definitions, &[target(LAYER_FORMAT, None), target(OWNER_FORMAT, None)]);
        descriptor.layout[0] = views.with_depth[samples].clone();
        descriptor.depth_stencil = Some(depth_test(DEPTH_FORMAT, true, CompareFunction::Always));
        cache.queue_render_pipeline(descriptor)
    });
    commands.insert_resource(UpsamplePipeline { shared, ids });
}
