//! The pipelines of the interpolate pass, specialized by [`InterpolateKey`].

use bevy::{
    prelude::*,
    render::render_resource::{
        BindGroupLayoutDescriptor, BindGroupLayoutEntries, CompareFunction, RenderPipelineDescriptor, ShaderStages,
        SpecializedRenderPipeline, TextureSampleType,
        binding_types::{storage_buffer_sized, texture_2d, texture_depth_2d},
    },
};

use crate::{
    gpu::Shaders,
    render::{
        attachment::depth_test,
        fullscreen::{Fullscreen, target},
        kept::KeptPart,
        view::{DEPTH_FORMAT, INDEX_FORMAT, LAYER_FORMAT, MOTION_FORMAT, OWNER_FORMAT, ViewLayouts},
    },
};

#[derive(Resource)]
pub(super) struct InterpolatePipeline {
    /// Without motion vectors, and with them.
    variants: [Fullscreen; 2],
    with_depth: [BindGroupLayoutDescriptor; 2],
}

impl InterpolatePipeline {
    /// Returns what the pipelines for layers with or without motion vectors share.
    pub fn shared(&self, motion: bool) -> &Fullscreen {
        &self.variants[usize::from(motion)]
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct InterpolateKey {
    pub multisampled: bool,
    /// Whether motion vectors are written.
    pub motion: bool,
}

pub(super) fn init(mut commands: Commands, views: Res<ViewLayouts>, shaders: Res<Shaders>) {
    let variants = [false, true].map(|motion| {
        let texture = || texture_2d(TextureSampleType::Float { filterable: false });
        let buffer = || storage_buffer_sized(false, None);
        let entries = (texture(), texture(), texture_depth_2d(), buffer(), buffer());
        let mut entries = BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, entries).to_vec();
        if motion {
            entries.push(texture().build(5, ShaderStages::FRAGMENT));
        }
        Fullscreen::new("plenoctree_interpolate", &shaders.interpolate, &entries, &shaders, &views)
            .unless_kept(KeptPart::Layer)
    });
    commands.insert_resource(InterpolatePipeline { variants, with_depth: views.with_depth.clone() });
}

impl SpecializedRenderPipeline for InterpolatePipeline {
    type Key = InterpolateKey;

    fn specialize(&self, InterpolateKey { multisampled, motion }: InterpolateKey) -> RenderPipelineDescriptor {
        let definitions = [(multisampled, "MULTISAMPLED"), (motion, "MOTION")];
        let definitions = definitions.into_iter().filter(|(holds, _)| *holds).map(|(_, name)| name.into());
        let mut targets = vec![target(LAYER_FORMAT, None), target(OWNER_FORMAT, None), target(INDEX_FORMAT, None)];
        if motion {
            targets.push(target(MOTION_FORMAT, None));
        }
        let mut descriptor = self.shared(motion).pipeline(definitions.collect(), &targets);
        descriptor.layout[0] = self.with_depth[usize::from(multisampled)].clone();
        descriptor.depth_stencil = Some(depth_test(DEPTH_FORMAT, true, CompareFunction::Always));
        descriptor
    }
}
