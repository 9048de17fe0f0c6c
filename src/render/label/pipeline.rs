//! The pipelines of the label pass.

use bevy::{
    prelude::*,
    render::render_resource::{
        BindGroupLayoutEntries, RenderPipelineDescriptor, ShaderStages, SpecializedRenderPipeline, TextureSampleType,
        binding_types::texture_2d,
    },
    shader::ShaderDefVal,
};

use super::textures::{LABEL_COLOR_FORMAT, LABEL_FORMAT};
use crate::{
    gpu::Shaders,
    render::{
        fullscreen::{Fullscreen, target},
        target::TargetKey,
        view::ViewLayouts,
    },
};

/// Writes labels, and the composite where nothing is posterized.
#[derive(Resource)]
pub(super) struct LabelPipeline {
    /// For views in which all edges of props are hard.
    pub hard: Fullscreen,
    /// For the others.
    pub smooth: Fullscreen,
}

pub(super) fn init(mut commands: Commands, views: Res<ViewLayouts>, shaders: Res<Shaders>) {
    let (integers, floats) =
        (|| texture_2d(TextureSampleType::Uint), || texture_2d(TextureSampleType::Float { filterable: false }));
    let pass = |entries: &[_]| Fullscreen::new("plenoctree_label", &shaders.label, entries, &shaders, &views);
    let stages = ShaderStages::FRAGMENT;
    commands.insert_resource(LabelPipeline {
        hard: pass(&BindGroupLayoutEntries::sequential(stages, (integers(), floats()))),
        smooth: pass(&BindGroupLayoutEntries::sequential(
            stages,
            (integers(), floats(), integers(), floats(), floats(), floats()),
        )),
    });
}

/// The output of the label pass.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum LabelKey {
    /// The view's target.
    Target(TargetKey),
    /// The textures for custom stages.
    Textures,
}

impl SpecializedRenderPipeline for LabelPipeline {
    /// The output, and whether any edges are smooth.
    type Key = (LabelKey, bool);

    fn specialize(&self, (key, smooth): Self::Key) -> RenderPipelineDescriptor {
        let pass = if smooth { &self.smooth } else { &self.hard };
        let mut descriptor = match key {
            LabelKey::Target(target) => target.pipeline(pass),
            LabelKey::Textures => {
                let targets = [target(LABEL_COLOR_FORMAT, None), target(LABEL_FORMAT, None)];
                pass.pipeline(vec!["LABEL_TEXTURES".into()], &targets)
            }
        };
        let samples = descriptor.multisample.count;
        if let Some(fragment) = descriptor.fragment.as_mut().filter(|_| smooth) {
            fragment.shader_defs.push("SMOOTH_EDGES".into());
            if samples > 1 {
                fragment.shader_defs.push(ShaderDefVal::UInt("SAMPLES".into(), samples));
            }
        }
        descriptor
    }
}
