//! The pipelines of the blend pass and of the patch pass, specialized by [`BlendKey`].

use bevy::{
    camera::CompositingSpace,
    prelude::*,
    render::render_resource::{
        BindGroupLayoutEntries, RenderPipelineDescriptor, ShaderStages, SpecializedRenderPipeline, TextureSampleType,
        binding_types::texture_2d,
    },
    shader::ShaderDefVal,
};

use crate::{
    gpu::Shaders,
    render::{
        edges::mask_test,
        fullscreen::{Fullscreen, target},
        kept::KeptPart,
        label::SHOWN_FORMAT,
        lighting::LightingLayout,
        target::target_definitions,
        view::ViewLayouts,
    },
};

#[derive(Resource)]
pub(super) struct BlendPipeline {
    pub blend: Fullscreen,
    pub patch: Fullscreen,
    lighting: LightingLayout,
}

#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum BlendKey {
    /// The blend pass.
    Blend {
        /// If the target has several samples per pixel, their number.
        samples: Option<u32>,
        /// Whether the scene's lights fall on a prop.
        is_lit: bool,
        /// The color space of the view's target.
        space: Option<CompositingSpace>,
    },
    Patch,
}

pub(super) fn init(
    mut commands: Commands,
    views: Res<ViewLayouts>,
    lighting: Res<LightingLayout>,
    shaders: Res<Shaders>,
) {
    let (integers, floats) =
        (|| texture_2d(TextureSampleType::Uint), || texture_2d(TextureSampleType::Float { filterable: false }));
    let stages = ShaderStages::FRAGMENT;
    let textures = (floats(), integers(), integers(), floats(), floats(), floats(), floats());
    let blend = BindGroupLayoutEntries::sequential(stages, textures);
    let patch = BindGroupLayoutEntries::single(stages, floats());
    let pass = |label, shader, entries: &[_]| {
        Fullscreen::new(label, shader, entries, &shaders, &views).unless_kept(KeptPart::Labels)
    };
    commands.insert_resource(BlendPipeline {
        blend: pass("plenoctree_blend", &shaders.blend, &blend),
        patch: pass("plenoctree_patch", &shaders.patch, &patch),
        lighting: lighting.clone(),
    });
}

impl SpecializedRenderPipeline for BlendPipeline {
    type Key = BlendKey;

    fn specialize(&self, key: BlendKey) -> RenderPipelineDescriptor {
        let (pass, definitions) = match key {
            BlendKey::Blend { samples, space, .. } => {
                let samples = samples.map(|samples| ShaderDefVal::UInt("SAMPLES".into(), samples));
                (&self.blend, target_definitions(space).into_iter().chain(samples).collect())
            }
            BlendKey::Patch => (&self.patch, vec![]),
        };
        let mut descriptor = pass.pipeline(definitions, &[target(SHOWN_FORMAT, None)]);
        descriptor.depth_stencil = Some(mask_test());
        if let BlendKey::Blend { is_lit: true, .. } = key {
            self.lighting.add_to(&mut descriptor);
        }
        descriptor
    }
}
