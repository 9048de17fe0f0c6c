//! The pipelines of the label pass.

use bevy::{
    prelude::*,
    render::render_resource::{
        BindGroupLayoutEntries, RenderPipelineDescriptor, ShaderStages, SpecializedRenderPipeline, TextureSampleType,
        binding_types::texture_2d,
    },
};

use super::textures::{LABEL_FORMAT, SHOWN_FORMAT};
use crate::{
    gpu::Shaders,
    render::{
        fullscreen::{Fullscreen, props_test, target},
        kept::KeptPart,
        lighting::LightingLayout,
        view::ViewLayouts,
    },
};

/// Assigns labels.
#[derive(Resource)]
pub(super) struct LabelPipeline {
    pub pass: Fullscreen,
    lighting: LightingLayout,
}

#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct LabelKey {
    /// Whether labels are written for custom stages.
    pub has_stages: bool,
    /// Whether the scene's lights fall on a prop.
    pub is_lit: bool,
    /// Whether only pixels are drawn where a prop was drawn, because others are cleared.
    pub tests_depth: bool,
}

pub(super) fn init(
    mut commands: Commands,
    views: Res<ViewLayouts>,
    lighting: Res<LightingLayout>,
    shaders: Res<Shaders>,
) {
    let textures = (texture_2d(TextureSampleType::Uint), texture_2d(TextureSampleType::Float { filterable: false }));
    let entries = BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, textures);
    let pass =
        Fullscreen::new("plenoctree_label", &shaders.label, &entries, &shaders, &views).unless_kept(KeptPart::Labels);
    commands.insert_resource(LabelPipeline { pass, lighting: lighting.clone() });
}

impl SpecializedRenderPipeline for LabelPipeline {
    type Key = LabelKey;

    fn specialize(&self, key: LabelKey) -> RenderPipelineDescriptor {
        let targets = [target(SHOWN_FORMAT, None), target(LABEL_FORMAT, None)];
        let mut descriptor = if key.has_stages {
            self.pass.pipeline(vec!["LABEL_TEXTURES".into()], &targets)
        } else {
            self.pass.pipeline(vec![], &targets[..1])
        };
        if key.tests_depth {
            descriptor.depth_stencil = Some(props_test());
        }
        if key.is_lit {
            self.lighting.add_to(&mut descriptor);
        }
        descriptor
    }
}
