//! The pipelines of the label pass.

use bevy::{
    prelude::*,
    render::render_resource::{
        BindGroupLayoutEntries, RenderPipelineDescriptor, ShaderStages, SpecializedRenderPipeline, TextureSampleType,
        binding_types::texture_2d,
    },
};

use super::textures::{LABEL_COLOR_FORMAT, LABEL_FORMAT};
use crate::{
    gpu::Shaders,
    render::{
        fullscreen::{Fullscreen, target},
        target::TargetKey,
        view::ViewLayouts,
    },
};

/// Writes labels, and the composite where nothing is posterized.
#[derive(Resource)]
pub(super) struct LabelPipeline(pub Fullscreen);

pub(super) fn init(mut commands: Commands, views: Res<ViewLayouts>, shaders: Res<Shaders>) {
    let entries = BindGroupLayoutEntries::sequential(
        ShaderStages::FRAGMENT,
        (texture_2d(TextureSampleType::Uint), texture_2d(TextureSampleType::Float { filterable: false })),
    );
    let pass = Fullscreen::new("plenoctree_label", &shaders.label, &entries, &shaders, &views);
    commands.insert_resource(LabelPipeline(pass));
}

/// The output of the label pass.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum LabelKey {
    /// The view's target.
    Target(TargetKey),
    /// The textures for custom stages.
    Textures,
}

impl SpecializedRenderPipeline for LabelPipeline {
    type Key = LabelKey;

    fn specialize(&self, key: LabelKey) -> RenderPipelineDescriptor {
        match key {
            LabelKey::Target(target) => target.pipeline(&self.0),
            LabelKey::Textures => {
                let targets = [target(LABEL_COLOR_FORMAT, None), target(LABEL_FORMAT, None)];
                self.0.pipeline(vec!["LABEL_TEXTURES".into()], &targets)
            }
        }
    }
}
