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
    /// For views of one prop, and of several. Created when a view first needs them.
    ids: [Option<CachedRenderPipelineId>; 2],
}

impl OutlinePipeline {
    /// Returns the pipeline, and creates it if it does not exist. If there are several props, it also clears what the
    /// coverage pass adds to.
    pub fn id(&mut self, cache: &PipelineCache, are_several: bool) -> CachedRenderPipelineId {
        *self.ids[usize::from(are_several)].get_or_insert_with(|| {
            let (mut targets, mut definitions) = (vec![target(OUTLINE_FORMAT, None)], vec![]);
            if are_several {
                targets.extend(coverage_targets(None));
                definitions.push("SEVERAL".into());
            }
            let mut descriptor = self.shared.pipeline(definitions, &targets);
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
    commands.insert_resource(OutlinePipeline { shared, ids: [None; 2] });
}
