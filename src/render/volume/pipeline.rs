//! The pipelines of the volume pass, specialized by [`VolumeKey`].

use bevy::{
    prelude::*,
    render::render_resource::{
        BindGroupLayoutDescriptor, BlendComponent, BlendFactor, BlendOperation, BlendState, CompareFunction,
        RenderPipelineDescriptor, SpecializedRenderPipeline,
    },
};

use crate::{
    gpu::{FieldLayouts, FieldShape, Shaders, field_definitions},
    render::{
        attachment::depth_test,
        boxes::Boxes,
        fullscreen::target,
        refine::RaysOf,
        solid::SolidLayouts,
        view::{DEPTH_FORMAT, LAYER_FORMAT, MOTION_FORMAT, OWNER_FORMAT, ViewLayouts},
    },
};

#[derive(Resource)]
pub(super) struct VolumePipeline {
    boxes: Boxes,
    solid: BindGroupLayoutDescriptor,
}

/// The specialization key of the shader. A field of SH1 does not pay for the arithmetic of SH9, and a prop that
/// overlaps no other does not pay for what overlapping props need.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct VolumeKey {
    pub shape: FieldShape,
    pub rays: RaysOf,
    pub multisampled: bool,
    pub overlapping: bool,
    /// Whether the scene's lights fall on the prop.
    pub lit: bool,
    /// Whether motion vectors are written.
    pub motion: bool,
}

pub(super) fn init(
    mut commands: Commands,
    layouts: Res<ViewLayouts>,
    fields: Res<FieldLayouts>,
    solid: Res<SolidLayouts>,
    shaders: Res<Shaders>,
) {
    commands.insert_resource(VolumePipeline {
        boxes: Boxes::new("plenoctree_volume", &shaders.volume, &shaders, &layouts, &fields),
        solid: solid.both.clone(),
    });
}

impl SpecializedRenderPipeline for VolumePipeline {
    type Key = VolumeKey;

    fn specialize(&self, key: VolumeKey) -> RenderPipelineDescriptor {
        let mut definitions = field_definitions(key.shape);
        if key.overlapping {
            definitions.push("OVERLAPPING".into());
        }
        if key.lit {
            definitions.push("LIT".into());
        }
        let over = |src_factor| BlendState {
            color: BlendComponent {
                src_factor,
                dst_factor: BlendFactor::OneMinusSrcAlpha,
                operation: BlendOperation::Add,
            },
            alpha: BlendComponent::OVER,
        };
        let mut targets = vec![
            target(LAYER_FORMAT, Some(over(BlendFactor::One))),
            // The nearest prop that is opaque enough owns the pixel.
            target(OWNER_FORMAT, Some(over(BlendFactor::SrcAlpha))),
        ];
        if key.motion {
            definitions.push("MOTION".into());
            targets.push(target(MOTION_FORMAT, Some(over(BlendFactor::SrcAlpha))));
        }
        let mut descriptor = self.boxes.pipeline(definitions, key.shape.into(), key.rays, key.multisampled, &targets);
        if key.overlapping {
            descriptor.layout.push(self.solid.clone());
        }
        // The depth is written, not tested: all props of a pixel write the same.
        descriptor.depth_stencil = Some(depth_test(DEPTH_FORMAT, true, CompareFunction::Always));
        descriptor
    }
}
