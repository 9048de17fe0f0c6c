//! The pipelines of the upsample pass.

use bevy::{
    prelude::*,
    render::render_resource::{
        BindGroupLayoutEntries, CachedRenderPipelineId, CompareFunction, PipelineCache, ShaderStages,
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
pub(in crate::render) struct UpsamplePipeline {
    /// Without motion vectors, and with them.
    variants: [Variant; 2],
}

struct Variant {
    shared: Fullscreen,
    /// For a single-sampled scene, and for a multisampled one.
    ids: [CachedRenderPipelineId; 2],
}

impl UpsamplePipeline {
    /// Returns what the pipelines for layers with or without motion vectors share.
    pub fn shared(&self, motion: bool) -> &Fullscreen {
        &self.variants[usize::from(motion)].shared
    }

    /// Returns whether that pipeline has been created.
    pub fn is_ready(&self, cache: &PipelineCache, msaa: &Msaa, motion: bool) -> bool {
        cache.get_render_pipeline(self.id(msaa, motion)).is_some()
    }

    /// Returns the pipeline for a scene with this number of samples per pixel.
    pub fn id(&self, msaa: &Msaa, motion: bool) -> CachedRenderPipelineId {
        self.variants[usize::from(motion)].ids[usize::from(msaa.samples() > 1)]
    }
}

pub(super) fn init(mut commands: Commands, views: Res<ViewLayouts>, shaders: Res<Shaders>, cache: Res<PipelineCache>) {
    let variants = [false, true].map(|motion| {
        let texture = || texture_2d(TextureSampleType::Float { filterable: false });
        let textures = (texture(), texture(), texture_depth_2d());
        let mut entries = BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, textures).to_vec();
        let mut targets = vec![target(LAYER_FORMAT, None), target(OWNER_FORMAT, None)];
        if motion {
            entries.push(texture().build(3, ShaderStages::FRAGMENT));
            targets.push(target(MOTION_FORMAT, None));
        }
        let shared = Fullscreen::new("plenoctree_upsample", &shaders.upsample, &entries, &shaders, &views)
            .unless_kept(KeptPart::Layer);
        let ids = [false, true].map(|multisampled| {
            let definitions = [(multisampled, "MULTISAMPLED"), (motion, "MOTION")];
            let definitions = definitions.into_iter().filter(|(holds, _)| *holds).map(|(_, name)| name.into());
            let mut descriptor = shared.pipeline(definitions.collect(), &targets);
            descriptor.layout[0] = views.with_depth[usize::from(multisampled)].clone();
            descriptor.depth_stencil = Some(depth_test(DEPTH_FORMAT, true, CompareFunction::Always));
            cache.queue_render_pipeline(descriptor)
        });
        Variant { shared, ids }
    });
    commands.insert_resource(UpsamplePipeline { variants });
}
