//! The pipelines of the fill pass, for layers without motion vectors and with them.

use bevy::{
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
        kept::KeptPart,
        view::{DEPTH_FORMAT, LAYER_FORMAT, MOTION_FORMAT, OWNER_FORMAT, ViewLayouts},
    },
};

#[derive(Resource)]
pub(super) struct FillPipeline([Fullscreen; 2]);

impl FillPipeline {
    /// Returns what the pipelines for layers with or without motion vectors share.
    pub fn shared(&self, motion: bool) -> &Fullscreen {
        &self.0[usize::from(motion)]
    }
}

pub(super) fn init(mut commands: Commands, views: Res<ViewLayouts>, shaders: Res<Shaders>) {
    commands.insert_resource(FillPipeline([false, true].map(|motion| {
        let texture = || texture_2d(TextureSampleType::Float { filterable: false });
        let (gaps, depth) = (texture_2d(TextureSampleType::Uint), texture_depth_2d);
        let entries = (gaps, texture(), texture(), depth(), texture(), texture(), depth());
        let mut entries = BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, entries).to_vec();
        if motion {
            entries.extend([7, 8].map(|binding| texture().build(binding, ShaderStages::FRAGMENT)));
        }
        Fullscreen::new("plenoctree_fill", &shaders.fill, &entries, &shaders, &views).unless_kept(KeptPart::Layer)
    })));
}

impl SpecializedRenderPipeline for FillPipeline {
    /// Whether motion vectors are written.
    type Key = bool;

    fn specialize(&self, motion: bool) -> RenderPipelineDescriptor {
        let mut targets = vec![target(LAYER_FORMAT, None), target(OWNER_FORMAT, None)];
        let mut definitions = vec![];
        if motion {
            targets.push(target(MOTION_FORMAT, None));
            definitions.push("MOTION".into());
        }
        let mut descriptor = self.shared(motion).pipeline(definitions, &targets);
        descriptor.depth_stencil = Some(depth_test(DEPTH_FORMAT, true, CompareFunction::Always));
        descriptor
    }
}
