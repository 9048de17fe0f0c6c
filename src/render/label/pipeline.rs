//! The pipelines of the label pass.

use bevy::{
    prelude::*,
    render::render_resource::{
        BindGroupLayoutEntries, CachedRenderPipelineId, PipelineCache, ShaderStages, TextureSampleType,
        binding_types::texture_2d,
    },
};

use super::textures::{LABEL_FORMAT, SHOWN_FORMAT};
use crate::{
    gpu::Shaders,
    render::{
        fullscreen::{Fullscreen, target},
        kept::KeptPart,
        view::ViewLayouts,
    },
};

/// Assigns labels.
#[derive(Resource)]
pub(super) struct LabelPipelines {
    pub shared: Fullscreen,
    /// Without the labels for custom stages, and with them.
    ids: [CachedRenderPipelineId; 2],
}

impl LabelPipelines {
    /// Returns the pipeline for views with or without custom stages.
    pub fn id(&self, has_stages: bool) -> CachedRenderPipelineId {
        self.ids[usize::from(has_stages)]
    }
}

pub(super) fn init(mut commands: Commands, views: Res<ViewLayouts>, shaders: Res<Shaders>, cache: Res<PipelineCache>) {
    let textures = (texture_2d(TextureSampleType::Uint), texture_2d(TextureSampleType::Float { filterable: false }));
    let entries = BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, textures);
    let shared =
        Fullscreen::new("plenoctree_label", &shaders.label, &entries, &shaders, &views).unless_kept(KeptPart::Labels);
    let targets = [target(SHOWN_FORMAT, None), target(LABEL_FORMAT, None)];
    let ids = [(&targets[..1], None), (&targets[..], Some("LABEL_TEXTURES"))].map(|(targets, definition)| {
        cache.queue_render_pipeline(shared.pipeline(definition.into_iter().map(Into::into).collect(), targets))
    });
    commands.insert_resource(LabelPipelines { shared, ids });
}
