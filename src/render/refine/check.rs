//! The pipelines of the check pass, for single-sampled scenes and multisampled ones.

use bevy::{
    prelude::*,
    render::render_resource::{
        BindGroupLayoutDescriptor, BindGroupLayoutEntries, RenderPipelineDescriptor, ShaderStages,
        SpecializedRenderPipeline, TextureSampleType,
        binding_types::{storage_buffer_sized, texture_2d, texture_depth_2d},
    },
};

use crate::{
    gpu::Shaders,
    render::{
        fullscreen::{Fullscreen, target},
        kept::KeptPart,
        view::{GAP_FORMAT, ViewLayouts},
    },
};

#[derive(Resource)]
pub(super) struct CheckPipeline {
    pub shared: Fullscreen,
    with_depth: [BindGroupLayoutDescriptor; 2],
}

pub(super) fn init(mut commands: Commands, views: Res<ViewLayouts>, shaders: Res<Shaders>) {
    let texture = || texture_2d(TextureSampleType::Float { filterable: false });
    let buffer = || storage_buffer_sized(false, None);
    let entries = (texture(), texture(), texture_depth_2d(), buffer(), buffer());
    let entries = BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, entries);
    let shared =
        Fullscreen::new("plenoctree_check", &shaders.check, &entries, &shaders, &views).unless_kept(KeptPart::Layer);
    commands.insert_resource(CheckPipeline { shared, with_depth: views.with_depth.clone() });
}

impl SpecializedRenderPipeline for CheckPipeline {
    /// Whether the scene is multisampled.
    type Key = bool;

    fn specialize(&self, multisampled: bool) -> RenderPipelineDescriptor {
        let definitions = if multisampled { vec!["MULTISAMPLED".into()] } else { vec![] };
        let mut descriptor = self.shared.pipeline(definitions, &[target(GAP_FORMAT, None)]);
        descriptor.layout[0] = self.with_depth[usize::from(multisampled)].clone();
        descriptor
    }
}
