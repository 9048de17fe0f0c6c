//! The pipelines of the outline pass, specialized by [`OutlineKey`].

use bevy::{
    prelude::*,
    render::render_resource::{
        BindGroupLayoutDescriptor, BindGroupLayoutEntries, CompareFunction, RenderPipelineDescriptor, ShaderStages,
        SpecializedRenderPipeline, TextureSampleType,
        binding_types::{texture_2d, texture_depth_2d},
    },
    shader::ShaderDefVal,
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
    with_depth: [BindGroupLayoutDescriptor; 2],
}

#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct OutlineKey {
    /// Whether the coverage is that of a coarse layer.
    pub coarse: bool,
    /// The number of samples of the scene per pixel.
    pub samples: u32,
}

pub(super) fn init(mut commands: Commands, views: Res<ViewLayouts>, shaders: Res<Shaders>) {
    let texture = || texture_2d(TextureSampleType::Float { filterable: false });
    let textures = (texture(), texture(), texture_depth_2d());
    let entries = BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, textures);
    commands.insert_resource(OutlinePipeline {
        shared: Fullscreen::new("plenoctree_outline", &shaders.outline, &entries, &shaders, &views)
            .unless_kept(KeptPart::Layer),
        with_depth: views.with_depth.clone(),
    });
}

impl SpecializedRenderPipeline for OutlinePipeline {
    type Key = OutlineKey;

    fn specialize(&self, key: OutlineKey) -> RenderPipelineDescriptor {
        let multisampled = key.samples > 1;
        let definitions = [(key.coarse, "COARSE"), (multisampled, "MULTISAMPLED")];
        let definitions = definitions.into_iter().filter(|(holds, _)| *holds).map(|(_, name)| name.into());
        let definitions = definitions.chain([ShaderDefVal::UInt("SAMPLES".into(), key.samples)]);
        let mut targets = vec![target(OUTLINE_FORMAT, None)];
        targets.extend(coverage_targets(None));
        let mut descriptor = self.shared.pipeline(definitions.collect(), &targets);
        descriptor.layout[0] = self.with_depth[usize::from(multisampled)].clone();
        descriptor.depth_stencil = Some(depth_test(DEPTH_FORMAT, true, CompareFunction::Always));
        descriptor
    }
}
