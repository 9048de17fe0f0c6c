//! The pipelines of the volume pass, specialized by [`VolumeKey`].

use bevy::{
    prelude::*,
    render::render_resource::{
        BindGroupLayoutDescriptor, BlendComponent, BlendFactor, BlendOperation, BlendState, CompareFunction, Face,
        FragmentState, PrimitiveState, RenderPipelineDescriptor, SpecializedRenderPipeline, VertexState,
    },
    shader::Shader,
};

use crate::{
    gpu::{FieldLayout, FieldShape, Shaders, field_definitions},
    render::{
        attachment::depth_test,
        fullscreen::target,
        view::{DEPTH_FORMAT, LAYER_FORMAT, OWNER_FORMAT, ViewLayouts},
    },
};

#[derive(Resource)]
pub(super) struct VolumePipeline {
    shader: Handle<Shader>,
    view: [BindGroupLayoutDescriptor; 2],
    field: FieldLayout,
}

/// The specialization key of the shader. A field of SH1 does not pay for the arithmetic of SH9.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct VolumeKey {
    pub shape: FieldShape,
    pub degree: u32,
    pub multisampled: bool,
}

pub(super) fn init(mut commands: Commands, layouts: Res<ViewLayouts>, field: Res<FieldLayout>, shaders: Res<Shaders>) {
    commands.insert_resource(VolumePipeline {
        shader: shaders.volume.clone(),
        view: layouts.with_depth.clone(),
        field: field.clone(),
    });
}

impl SpecializedRenderPipeline for VolumePipeline {
    type Key = VolumeKey;

    fn specialize(&self, key: VolumeKey) -> RenderPipelineDescriptor {
        let mut definitions = field_definitions(key.shape, key.degree);
        if key.multisampled {
            definitions.push("MULTISAMPLED".into());
        }
        let over = |src_factor| BlendState {
            color: BlendComponent {
                src_factor,
                dst_factor: BlendFactor::OneMinusSrcAlpha,
                operation: BlendOperation::Add,
            },
            alpha: BlendComponent::OVER,
        };
        RenderPipelineDescriptor {
            label: Some("plenoctree_volume".into()),
            layout: vec![self.view[usize::from(key.multisampled)].clone(), self.field.0.clone()],
            vertex: VertexState {
                shader: self.shader.clone(),
                shader_defs: definitions.clone(),
                entry_point: Some("vertex".into()),
                ..default()
            },
            depth_stencil: Some(depth_test(DEPTH_FORMAT, true, CompareFunction::GreaterEqual)),
            // Draw back faces: each pixel of the box is drawn once, even from inside it.
            primitive: PrimitiveState { cull_mode: Some(Face::Front), ..default() },
            fragment: Some(FragmentState {
                shader: self.shader.clone(),
                shader_defs: definitions,
                entry_point: Some("fragment".into()),
                targets: vec![
                    Some(target(LAYER_FORMAT, Some(over(BlendFactor::One)))),
                    // The nearest prop that is opaque enough owns the pixel.
                    Some(target(OWNER_FORMAT, Some(over(BlendFactor::SrcAlpha)))),
                ],
            }),
            ..default()
        }
    }
}
