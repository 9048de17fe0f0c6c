//! The pipeline of the outline pass.

use bevy::{
    prelude::*,
    render::render_resource::{
        BindGroupLayoutEntries, CachedRenderPipelineId, CompareFunction, PipelineCache, ShaderStages,
        TextureSampleType,
        binding_types::{texture_2d, texture_depth_2d},
    },
};

use super::textures::{OUTLINE_FORMAT, coverage_targets};
use crate::{
    gpu::Shaders,
    render::{
        attachment::depth_test,
        fullscreen::{Fullscreen, target},
        kept::KeptPart,
        view::{DEPTH_FORMAT, ViewLayouts},
    },
};

#[derive(Resource)]
pub(super) struct OutlinePipeline {
    pub shared: Fullscreen,
    /// Created when a view first needs it.
    id: Option<CachedRenderPipelineId>,
}

impl OutlinePipeline {
    /// Returns the pipeline, and creates it if it does not exist.
    pub fn id(&mut self, cache: &PipelineCache) -> CachedRenderPipelineId {
        *self.id.get_or_insert_with(|| {
            let mut targets = vec![target(OUTLINE_FORMAT, None)];
            targets.extend(coverage_targets(None));
            let mut descriptor = self.shared.pipeline(vec![], &targets);
            descriptor.depth_stencil = Some(depth_test(DEPTH_FORMAT, true, CompareFunction::Always));
            cache.queue_render_pipeline(descriptor)
        })
    }
}

pub(super) fn init(mut commands: Commands, views: Res<ViewLayouts>, shaders: Res<Shaders>) {
    let texture = || texture_2d(TextureSampleType::Float { filterable: false });
    let textures = (texture(), texture(), texture_depth_2d());
    let entries = BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, textures);
    let shared = Fullscreen::new("plenoctree_outline", &shaders.outline, &entries, &shaders, &views)
        .unless_kept(KeptPart::Layer);
    commands.insert_resource(OutlinePipeline { shared, id: None });
}
