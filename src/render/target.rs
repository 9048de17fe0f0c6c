//! The view's target, as the last passes write it.

use bevy::{
    camera::CompositingSpace,
    prelude::*,
    render::{
        camera::ExtractedCamera,
        render_resource::{
            BlendComponent, BlendState, ColorTargetState, RenderPassColorAttachment, RenderPipelineDescriptor,
            TextureFormat,
        },
        view::{ExtractedView, ViewTarget},
    },
    shader::ShaderDefVal,
};

use super::{
    fullscreen::{Fullscreen, target},
    view::ViewProps,
};
use crate::stage::PropStage;

/// The properties of a view's target that pipelines depend on.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct TargetKey {
    format: TextureFormat,
    samples: u32,
    space: Option<CompositingSpace>,
}

impl TargetKey {
    pub fn new(view: &ExtractedView, camera: &ExtractedCamera, msaa: &Msaa, stage: PropStage) -> Self {
        let samples = match stage {
            PropStage::Scene => msaa.samples(),
            PropStage::Display => 1,
        };
        Self { format: view.target_format, samples, space: camera.compositing_space }
    }

    /// Returns the pipeline of a pass that writes colors that are already composited: color is replaced, and alpha is
    /// blended over the target's alpha.
    pub fn pipeline(&self, pass: &Fullscreen) -> RenderPipelineDescriptor {
        let blend = BlendState { color: BlendComponent::REPLACE, alpha: BlendComponent::OVER };
        let target: ColorTargetState = target(self.format, Some(blend));
        let mut descriptor = pass.pipeline(target_definitions(self.space), &[target]);
        descriptor.multisample.count = self.samples;
        descriptor
    }
}

/// Returns the number of samples per pixel of a target in which some samples may show something in front of a prop,
/// while others show the prop. `None` if there is only one, or if custom stages or a posterized view decide what is
/// shown.
pub(super) fn hidden_samples(props: &ViewProps, msaa: &Msaa) -> Option<u32> {
    let shows_scene = props.stage == PropStage::Scene && !props.has_stages && props.view.get().everything == 0;
    Some(msaa.samples()).filter(|samples| *samples > 1 && shows_scene)
}

/// Returns the attachment that [`TargetKey`] describes.
pub(super) fn target_attachment(target: &ViewTarget, stage: PropStage) -> RenderPassColorAttachment<'_> {
    match stage {
        PropStage::Scene => target.get_color_attachment(),
        // Post-processing continues with the resolved texture.
        PropStage::Display => target.get_unsampled_color_attachment(),
    }
}

/// Returns the shader definitions for `target.wgsl`.
pub(super) fn target_definitions(space: Option<CompositingSpace>) -> Vec<ShaderDefVal> {
    match space {
        Some(CompositingSpace::Srgb) => vec!["SRGB_TARGET".into()],
        Some(CompositingSpace::Oklab) => vec!["OKLAB_TARGET".into()],
        Some(CompositingSpace::Linear) | None => vec![],
    }
}
