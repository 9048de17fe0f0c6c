//! The pipelines of the coverage pass, specialized by [`CoverageKey`].

use bevy::{
    prelude::*,
    render::render_resource::{
        BindGroupLayoutDescriptor, BindGroupLayoutEntries, BlendComponent, BlendFactor, BlendOperation, BlendState,
        RenderPipelineDescriptor, ShaderStages, SpecializedRenderPipeline, TextureSampleType,
        binding_types::{texture_2d, texture_depth_2d},
    },
    shader::{Shader, ShaderDefVal},
};

use super::textures::{coverage_targets, mask_test};
use crate::{
    gpu::{FieldLayout, FieldShape, Shaders, field_definitions},
    render::{boxes::Boxes, refine::RaysOf, view::ViewLayouts},
};

#[derive(Resource)]
pub(super) struct CoveragePipeline {
    boxes: Boxes,
    shader: Handle<Shader>,
    pub label: &'static str,
    /// The layout of bind group 2.
    pub layout: BindGroupLayoutDescriptor,
}

#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct CoverageKey {
    pub shape: FieldShape,
    /// The number of samples of the scene per pixel.
    pub samples: u32,
}

pub(super) fn init(mut commands: Commands, views: Res<ViewLayouts>, field: Res<FieldLayout>, shaders: Res<Shaders>) {
    let label = "plenoctree_coverage";
    let owner = texture_2d(TextureSampleType::Float { filterable: false });
    let textures = (texture_2d(TextureSampleType::Uint), owner, texture_depth_2d());
    let entries = BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, textures);
    commands.insert_resource(CoveragePipeline {
        boxes: Boxes::new(label, &shaders.coverage, &shaders, &views, &field),
        shader: shaders.coverage.clone(),
        label,
        layout: BindGroupLayoutDescriptor::new(label, &entries),
    });
}

impl SpecializedRenderPipeline for CoveragePipeline {
    type Key = CoverageKey;

    fn specialize(&self, key: CoverageKey) -> RenderPipelineDescriptor {
        let mut definitions = field_definitions(key.shape);
        definitions.push(ShaderDefVal::UInt("SAMPLES".into(), key.samples));
        let sum = BlendComponent {
            src_factor: BlendFactor::One,
            dst_factor: BlendFactor::One,
            operation: BlendOperation::Add,
        };
        let targets = coverage_targets(Some(BlendState { color: sum, alpha: sum }));
        let mut descriptor = self.boxes.pipeline(definitions, RaysOf::Grid, key.samples > 1, &targets);
        // It draws one triangle instead of a box.
        descriptor.vertex.shader = self.shader.clone();
        descriptor.primitive = default();
        descriptor.depth_stencil = Some(mask_test());
        descriptor.layout.push(self.layout.clone());
        descriptor
    }
}
