//! The pipelines of the prepass pass, specialized by [`PrepassKey`].

use bevy::{
    core_pipeline::core_3d::CORE_3D_DEPTH_FORMAT,
    prelude::*,
    render::render_resource::{
        BindGroupLayoutEntries, CompareFunction, RenderPipelineDescriptor, ShaderStages, SpecializedRenderPipeline,
        TextureSampleType,
        binding_types::{texture_2d, texture_depth_2d},
    },
};

use crate::{
    gpu::Shaders,
    render::{
        attachment::depth_test,
        fullscreen::{Fullscreen, target},
        view::{MOTION_FORMAT, ViewLayouts},
    },
};

/// Writes depth, motion vectors, or both.
#[derive(Resource)]
pub(super) struct PrepassPipeline([Fullscreen; 2]);

impl PrepassPipeline {
    /// Returns the pass with or without motion vectors.
    pub fn pass(&self, motion: bool) -> &Fullscreen {
        &self.0[usize::from(motion)]
    }
}

/// The textures of a view's prepass.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct PrepassKey {
    pub motion: bool,
    pub depth: bool,
    pub samples: u32,
}

pub(super) fn init(mut commands: Commands, views: Res<ViewLayouts>, shaders: Res<Shaders>) {
    let stages = ShaderStages::FRAGMENT;
    let motion = texture_2d(TextureSampleType::Float { filterable: false });
    let layouts = [
        BindGroupLayoutEntries::single(stages, texture_depth_2d()).to_vec(),
        BindGroupLayoutEntries::sequential(stages, (texture_depth_2d(), motion)).to_vec(),
    ];
    let pass = |entries: Vec<_>| Fullscreen::new("plenoctree_prepass", &shaders.prepass, &entries, &shaders, &views);
    commands.insert_resource(PrepassPipeline(layouts.map(pass)));
}

impl SpecializedRenderPipeline for PrepassPipeline {
    type Key = PrepassKey;

    fn specialize(&self, key: PrepassKey) -> RenderPipelineDescriptor {
        let definitions = [(key.motion, "MOTION"), (key.depth, "DEPTH")];
        let definitions = definitions.into_iter().filter(|(holds, _)| *holds).map(|(_, name)| name.into());
        let targets = key.motion.then(|| target(MOTION_FORMAT, None));
        let mut descriptor = self.pass(key.motion).pipeline(definitions.collect(), targets.as_slice());
        descriptor.multisample.count = key.samples;
        descriptor.depth_stencil = key.depth.then(|| depth_test(CORE_3D_DEPTH_FORMAT, true, CompareFunction::Greater));
        descriptor
    }
}
