//! The pipelines of the solid pass, specialized by [`SolidKey`].

use bevy::{
    prelude::*,
    render::render_resource::{
        BindGroupLayoutDescriptor, CompareFunction, RenderPipelineDescriptor, SpecializedRenderPipeline,
    },
};

use super::textures::{SOLID_FORMAT, SolidLayouts};
use crate::{
    gpu::{FieldLayouts, Shaders, TreeShape},
    render::{
        attachment::depth_test,
        boxes::Boxes,
        fullscreen::target,
        refine::RaysOf,
        view::{DEPTH_FORMAT, ViewLayouts},
    },
};

#[derive(Resource)]
pub(super) struct SolidPipeline {
    boxes: Boxes,
    first: BindGroupLayoutDescriptor,
}

/// The specialization key of the shader.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct SolidKey {
    pub tree: TreeShape,
    pub rays: RaysOf,
    pub multisampled: bool,
    pub second_round: bool,
}

pub(super) fn init(
    mut commands: Commands,
    layouts: Res<ViewLayouts>,
    fields: Res<FieldLayouts>,
    solid: Res<SolidLayouts>,
    shaders: Res<Shaders>,
) {
    commands.insert_resource(SolidPipeline {
        boxes: Boxes::new("plenoctree_solid", &shaders.solid, &shaders, &layouts, &fields),
        first: solid.first.clone(),
    });
}

impl SpecializedRenderPipeline for SolidPipeline {
    type Key = SolidKey;

    fn specialize(&self, key: SolidKey) -> RenderPipelineDescriptor {
        let mut definitions = Vec::new();
        if key.second_round {
            definitions.push("SECOND_ROUND".into());
        }
        let mut descriptor =
            self.boxes.pipeline(definitions, key.tree, key.rays, key.multisampled, &[target(SOLID_FORMAT, None)]);
        if key.second_round {
            descriptor.layout.push(self.first.clone());
        }
        descriptor.depth_stencil = Some(depth_test(DEPTH_FORMAT, true, CompareFunction::Greater));
        descriptor
    }
}
