//! The pipelines of the composite pass.

use bevy::{
    camera::CompositingSpace,
    prelude::*,
    render::render_resource::{
        BindGroupLayoutEntries, RenderPipelineDescriptor, ShaderStages, SpecializedRenderPipeline, TextureSampleType,
        binding_types::texture_2d,
    },
};

use super::textures::COMPOSITE_FORMAT;
use crate::{
    gpu::Shaders,
    render::{
        fullscreen::{Fullscreen, target},
        kept::KeptPart,
        target::target_definitions,
        view::ViewLayouts,
    },
};

/// Blends the props over the scene.
#[derive(Resource)]
pub(super) struct CompositePipeline(pub Fullscreen);

pub(super) fn init(mut commands: Commands, views: Res<ViewLayouts>, shaders: Res<Shaders>) {
    let texture = || texture_2d(TextureSampleType::Float { filterable: false });
    let entries = BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, (texture(), texture(), texture()));
    let pass = Fullscreen::new("plenoctree_composite", &shaders.composite, &entries, &shaders, &views);
    commands.insert_resource(CompositePipeline(pass.unless_kept(KeptPart::Composite)));
}

impl SpecializedRenderPipeline for CompositePipeline {
    /// The color space of the view's target, and whether the composite is filtered.
    type Key = (Option<CompositingSpace>, bool);

    fn specialize(&self, (space, filtered): Self::Key) -> RenderPipelineDescriptor {
        let mut definitions = target_definitions(space);
        if !filtered {
            definitions.push("UNFILTERED".into());
        }
        let textures = if filtered { 2 } else { 1 };
        self.0.pipeline(definitions, &vec![target(COMPOSITE_FORMAT, None); textures])
    }
}
