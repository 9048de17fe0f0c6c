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

use super::textures::{PLACES_FORMAT, coverage_targets, mask_test};
use crate::{
    gpu::{FieldLayouts, FieldShape, Shaders, field_definitions},
    render::{boxes::Boxes, fullscreen::target, refine::RaysOf, view::ViewLayouts},
};

#[derive(Resource)]
pub(super) struct CoveragePipeline {
    boxes: Boxes,
    shader: Handle<Shader>,
    pub label: &'static str,
    /// The layout of bind group 2.
    pub layout: BindGroupLayoutDescriptor,
    /// The same, for [`Part::OfOthers`].
    pub layout_of_others: BindGroupLayoutDescriptor,
}

/// The pixels of a prop that a pipeline draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Part {
    /// All of them, of the only prop of a view.
    Alone,
    /// All of them.
    All,
    /// Those that the prop owns, where another one may be before it. Writes where the rays reach it, for those that
    /// follow.
    OfOwners,
    /// The others: those that another prop owns or none does, and those where no other one may be before it.
    OfOthers,
}

#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct CoverageKey {
    pub shape: FieldShape,
    /// The number of samples of the scene per pixel.
    pub samples: u32,
    pub part: Part,
}

pub(super) fn init(mut commands: Commands, views: Res<ViewLayouts>, fields: Res<FieldLayouts>, shaders: Res<Shaders>) {
    let label = "plenoctree_coverage";
    let owner = texture_2d(TextureSampleType::Float { filterable: false });
    let textures = (texture_2d(TextureSampleType::Uint), owner, texture_depth_2d());
    let entries = BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, textures).to_vec();
    let mut with_places = entries.clone();
    with_places.push(texture_2d(TextureSampleType::Uint).build(3, ShaderStages::FRAGMENT));
    commands.insert_resource(CoveragePipeline {
        boxes: Boxes::new(label, &shaders.coverage, &shaders, &views, &fields),
        shader: shaders.coverage.clone(),
        label,
        layout: BindGroupLayoutDescriptor::new(label, &entries),
        layout_of_others: BindGroupLayoutDescriptor::new(label, &with_places),
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
        let blend = (key.part != Part::Alone).then_some(BlendState { color: sum, alpha: sum });
        let mut targets = coverage_targets(blend);
        match key.part {
            Part::Alone | Part::All => {}
            Part::OfOwners => {
                definitions.push("OF_OWNERS".into());
                targets[2] = target(PLACES_FORMAT, None);
            }
            Part::OfOthers => definitions.push("OF_OTHERS".into()),
        }
        let mut descriptor =
            self.boxes.pipeline(definitions, key.shape.into(), RaysOf::Grid, key.samples > 1, &targets);
        // It draws one triangle instead of a box.
        descriptor.vertex.shader = self.shader.clone();
        descriptor.primitive = default();
        descriptor.depth_stencil = Some(mask_test());
        let layout = if key.part == Part::OfOthers { &self.layout_of_others } else { &self.layout };
        descriptor.layout.push(layout.clone());
        descriptor
    }
}
