//! The pipelines of the label pass.

use bevy::{
    camera::CompositingSpace,
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
        target::target_definitions,
        view::ViewLayouts,
    },
};

/// Assigns labels.
#[derive(Resource)]
pub(super) struct LabelPipeline {
    /// Reads the filtered composite.
    pub posterized: Fullscreen,
    /// Where nothing is posterized: blends the layer over the scene itself.
    pub as_trained: Fullscreen,
    lighting: LightingLayout,
}

#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct LabelKey {
    pub source: LabelSource,
    /// Whether labels are written for custom stages.
    pub has_stages: bool,
    /// Whether the scene's lights fall on a prop.
    pub is_lit: bool,
    /// Whether only pixels are drawn where a prop was drawn, because others are cleared.
    pub tests_depth: bool,
}

/// What the label pass reads.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum LabelSource {
    /// The filtered composite.
    Composite,
    /// The scene, in the color space of the view's target.
    Scene(Option<CompositingSpace>),
}

pub(super) fn init(
    mut commands: Commands,
    views: Res<ViewLayouts>,
    lighting: Res<LightingLayout>,
    shaders: Res<Shaders>,
) {
    let pass = |source| {
        let textures = (texture_2d(source), texture_2d(TextureSampleType::Float { filterable: false }));
        let entries = BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, textures);
        Fullscreen::new("plenoctree_label", &shaders.label, &entries, &shaders, &views).unless_kept(KeptPart::Labels)
    };
    commands.insert_resource(LabelPipeline {
        posterized: pass(TextureSampleType::Uint),
        as_trained: pass(TextureSampleType::Float { filterable: false }),
        lighting: lighting.clone(),
    });
}

impl SpecializedRenderPipeline for LabelPipeline {
    type Key = LabelKey;

    fn specialize(&self, key: LabelKey) -> RenderPipelineDescriptor {
        let targets = [target(SHOWN_FORMAT, None), target(LABEL_FORMAT, None)];
        let (pass, mut definitions) = match key.source {
            LabelSource::Composite => (&self.posterized, vec![]),
            LabelSource::Scene(space) => {
                let mut definitions = target_definitions(space);
                definitions.push("UNPOSTERIZED".into());
                (&self.as_trained, definitions)
            }
        };
        if key.has_stages {
            definitions.push("LABEL_TEXTURES".into());
        }
        let mut descriptor = pass.pipeline(definitions, &targets[..1 + usize::from(key.has_stages)]);
        if key.tests_depth {
            descriptor.depth_stencil = Some(props_test());
        }
        if key.is_lit {
            self.lighting.add_to(&mut descriptor);
        }
        descriptor
    }
}
