//! The pipelines of the present pass.

use bevy::{
    prelude::*,
    render::render_resource::{
        BindGroupLayoutEntries, RenderPipelineDescriptor, ShaderStages, SpecializedRenderPipeline, TextureSampleType,
        binding_types::texture_2d,
    },
    shader::ShaderDefVal,
};

use crate::{
    gpu::Shaders,
    render::{fullscreen::Fullscreen, target::TargetKey, view::ViewLayouts},
};

/// Writes to the view's target.
#[derive(Resource)]
pub(super) struct PresentPipeline {
    /// For all samples of pixels.
    pub whole: Fullscreen,
    /// For targets with several samples per pixel in which the edges of props are smooth: keeps the samples where
    /// something else is in front of a prop.
    pub hidden: Fullscreen,
}

pub(super) fn init(mut commands: Commands, views: Res<ViewLayouts>, shaders: Res<Shaders>) {
    let (integers, floats) =
        (|| texture_2d(TextureSampleType::Uint), || texture_2d(TextureSampleType::Float { filterable: false }));
    let pass = |entries: &[_]| Fullscreen::new("plenoctree_present", &shaders.present, entries, &shaders, &views);
    let stages = ShaderStages::FRAGMENT;
    commands.insert_resource(PresentPipeline {
        whole: pass(&BindGroupLayoutEntries::single(stages, floats())),
        hidden: pass(&BindGroupLayoutEntries::sequential(stages, (floats(), integers(), floats()))),
    });
}

impl SpecializedRenderPipeline for PresentPipeline {
    /// The target and, if some of its samples may be hidden, their number per pixel.
    type Key = (TargetKey, Option<u32>);

    fn specialize(&self, (target, samples): Self::Key) -> RenderPipelineDescriptor {
        let mut descriptor = target.pipeline(if samples.is_some() { &self.hidden } else { &self.whole });
        if let Some(fragment) = &mut descriptor.fragment {
            fragment.shader_defs.extend(samples.map(|samples| ShaderDefVal::UInt("SAMPLES".into(), samples)));
        }
        descriptor
    }
}
