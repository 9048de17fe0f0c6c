//! Pipelines that draw the boxes around props' leaves, whose fragments march.

use bevy::{
    prelude::*,
    render::render_resource::{
        BindGroupLayoutDescriptor, ColorTargetState, Face, FragmentState, PrimitiveState, RenderPipelineDescriptor,
        VertexState,
    },
    shader::{Shader, ShaderDefVal},
};

use super::view::ViewLayouts;
use crate::gpu::{FieldLayout, Shaders};

/// The number of vertices of a box.
pub(super) const BOX_VERTICES: u32 = 36;

/// A pass that draws boxes. Bind group 0 is the view's, and bind group 1 the field's.
pub(super) struct Boxes {
    label: &'static str,
    vertex: Handle<Shader>,
    fragment: Handle<Shader>,
    view: [BindGroupLayoutDescriptor; 2],
    field: BindGroupLayoutDescriptor,
}

impl Boxes {
    pub fn new(
        label: &'static str,
        fragment: &Handle<Shader>,
        shaders: &Shaders,
        views: &ViewLayouts,
        field: &FieldLayout,
    ) -> Self {
        Self {
            label,
            vertex: shaders.boxes.clone(),
            fragment: fragment.clone(),
            view: views.with_depth.clone(),
            field: field.0.clone(),
        }
    }

    /// Returns a pipeline without a depth test, for a single-sampled or a multisampled scene.
    pub fn pipeline(
        &self,
        mut definitions: Vec<ShaderDefVal>,
        multisampled: bool,
        targets: &[ColorTargetState],
    ) -> RenderPipelineDescriptor {
        if multisampled {
            definitions.push("MULTISAMPLED".into());
        }
        RenderPipelineDescriptor {
            label: Some(self.label.into()),
            layout: vec![self.view[usize::from(multisampled)].clone(), self.field.clone()],
            vertex: VertexState {
                shader: self.vertex.clone(),
                shader_defs: definitions.clone(),
                entry_point: Some("vertex".into()),
                ..default()
            },
            // Draw back faces: each pixel of the box is drawn once, even from inside it.
            primitive: PrimitiveState { cull_mode: Some(Face::Front), ..default() },
            fragment: Some(FragmentState {
                shader: self.fragment.clone(),
                shader_defs: definitions,
                entry_point: Some("fragment".into()),
                targets: targets.iter().cloned().map(Some).collect(),
            }),
            ..default()
        }
    }
}
