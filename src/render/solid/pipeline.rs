//! The pipelines of the solid pass, specialized by [`SolidKey`].

use bevy::{
    prelude::*,
    render::render_resource::{CompareFunction, RenderPipelineDescriptor, SpecializedRenderPipeline},
};

use super::textures::SOLID_FORMAT;
use crate::{
    gpu::{FieldLayout, Shaders},
    render::{
        attachment::depth_test,
        boxes::Boxes,
        fullscreen::target,
        view::{DEPTH_FORMAT, ViewLayouts},
    },
};

#[derive(Resource)]
pub(super) struct SolidPipeline(Boxes);

/// The specialization key of the shader.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct SolidKey {
    /// Whether the field has child records besides the table.
    pub inner_records: bool,
    pub multisampled: bool,
}

pub(super) fn init(mut commands: Commands, layouts: Res<ViewLayouts>, field: Res<FieldLayout>, shaders: Res<Shaders>) {
    commands.insert_resource(SolidPipeline(Boxes::new("plenoctree_solid", &shaders.solid, &shaders, &layouts, &field)));
}

impl SpecializedRenderPipeline for SolidPipeline {
    type Key = SolidKey;

    fn specialize(&self, key: SolidKey) -> RenderPipelineDescriptor {
        let definitions = if key.inner_records { vec!["INNER_RECORDS".into()] } else { vec![] };
        let mut descriptor = self.0.pipeline(definitions, key.multisampled, &[target(SOLID_FORMAT, None)]);
        descriptor.depth_stencil = Some(depth_test(DEPTH_FORMAT, true, CompareFunction::Greater));
        descriptor
    }
}
