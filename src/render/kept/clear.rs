//! Clears the attachments of passes whose results may be kept.

use bevy::{
    prelude::*,
    render::{
        render_phase::TrackedRenderPass,
        render_resource::{BindGroup, CachedRenderPipelineId, CompareFunction, PipelineCache},
    },
};

use super::part::KeptPart;
use crate::{
    gpu::Shaders,
    render::{
        attachment::depth_test,
        fullscreen::{Fullscreen, target},
        solid::SOLID_FORMAT,
        view::{DEPTH_FORMAT, LAYER_FORMAT, MOTION_FORMAT, OWNER_FORMAT, ViewLayouts},
    },
};

/// The attachments that are cleared.
#[derive(Clone, Copy)]
pub(in crate::render) enum Cleared {
    /// The layer.
    Layer,
    /// The layer with motion vectors.
    LayerWithMotion,
    /// A round of the solid pass.
    Solid,
}

/// The pipelines that clear attachments, one for each variant of [`Cleared`].
#[derive(Resource)]
pub(in crate::render) struct ClearPipelines([CachedRenderPipelineId; 3]);

impl ClearPipelines {
    pub(super) fn are_ready(&self, cache: &PipelineCache) -> bool {
        self.0.iter().all(|id| cache.get_render_pipeline(*id).is_some())
    }

    /// Clears the attachments of `pass`, unless they are kept. `view` is bind group 0 without the scene's depth.
    pub fn draw<'a>(
        &self,
        pass: &mut TrackedRenderPass<'a>,
        cache: &'a PipelineCache,
        view: &'a BindGroup,
        what: Cleared,
    ) {
        let Some(pipeline) = cache.get_render_pipeline(self.0[what as usize]) else {
            return;
        };
        pass.set_render_pipeline(pipeline);
        pass.set_bind_group(0, view, &[]);
        pass.draw(0..3, 0..1);
    }
}

pub(super) fn init(mut commands: Commands, views: Res<ViewLayouts>, shaders: Res<Shaders>, cache: Res<PipelineCache>) {
    let clear = Fullscreen::new("plenoctree_clear", &shaders.clear, &[], &shaders, &views).unless_kept(KeptPart::Layer);
    let layer = [LAYER_FORMAT, OWNER_FORMAT, MOTION_FORMAT];
    let pipelines = [(&layer[..2], None), (&layer[..], Some("MOTION")), (&[SOLID_FORMAT][..], Some("SOLID"))];
    commands.insert_resource(ClearPipelines(pipelines.map(|(formats, definition)| {
        let targets: Vec<_> = formats.iter().map(|format| target(*format, None)).collect();
        let mut descriptor = clear.pipeline(definition.into_iter().map(Into::into).collect(), &targets);
        // There is no bind group 1.
        descriptor.layout.truncate(1);
        descriptor.depth_stencil = Some(depth_test(DEPTH_FORMAT, true, CompareFunction::Always));
        cache.queue_render_pipeline(descriptor)
    })));
}
