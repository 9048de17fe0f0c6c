//! Pipelines that draw the boxes around props' leaves, or the batches of pixels in them, whose fragments march.

use bevy::{
    prelude::*,
    render::{
        render_phase::TrackedRenderPass,
        render_resource::{
            BindGroupLayoutDescriptor, ColorTargetState, Face, FragmentState, PrimitiveState, RenderPipelineDescriptor,
            VertexState,
        },
    },
    shader::{Shader, ShaderDefVal},
};

use super::{
    refine::{BATCH, RaysOf, batch_side, batches},
    view::{DrawnProp, ViewLayouts, ViewProps},
};
use crate::gpu::{FieldLayouts, Shaders, TreeShape};

/// The number of vertices of a box.
const BOX_VERTICES: u32 = 36;

/// A pass that marches through props. Bind group 0 is the view's, and bind group 1 the field's.
pub(super) struct Boxes {
    label: &'static str,
    boxes: Handle<Shader>,
    batches: Handle<Shader>,
    fragment: Handle<Shader>,
    with_depth: [BindGroupLayoutDescriptor; 2],
    with_batches: [BindGroupLayoutDescriptor; 2],
    fields: FieldLayouts,
}

impl Boxes {
    pub fn new(
        label: &'static str,
        fragment: &Handle<Shader>,
        shaders: &Shaders,
        views: &ViewLayouts,
        fields: &FieldLayouts,
    ) -> Self {
        Self {
            label,
            boxes: shaders.boxes.clone(),
            batches: shaders.batches.clone(),
            fragment: fragment.clone(),
            with_depth: views.with_depth.clone(),
            with_batches: views.with_batches.clone(),
            fields: fields.clone(),
        }
    }

    /// Returns a pipeline without a depth test, for a single-sampled or a multisampled scene.
    pub fn pipeline(
        &self,
        mut definitions: Vec<ShaderDefVal>,
        tree: TreeShape,
        rays: RaysOf,
        multisampled: bool,
        targets: &[ColorTargetState],
    ) -> RenderPipelineDescriptor {
        definitions.extend(self.fields.definitions(tree));
        if multisampled {
            definitions.push("MULTISAMPLED".into());
        }
        let (views, vertex, cull_mode) = match rays {
            // Draw back faces: each pixel of the box is drawn once, even from inside it.
            RaysOf::Grid => (&self.with_depth, &self.boxes, Some(Face::Front)),
            RaysOf::Batches => {
                definitions.push("BATCHED".into());
                (&self.with_batches, &self.batches, None)
            }
        };
        RenderPipelineDescriptor {
            label: Some(self.label.into()),
            layout: vec![views[usize::from(multisampled)].clone(), self.fields.of(tree).clone()],
            vertex: VertexState {
                shader: vertex.clone(),
                shader_defs: definitions.clone(),
                entry_point: Some("vertex".into()),
                ..default()
            },
            primitive: PrimitiveState { cull_mode, ..default() },
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

/// Draws a prop to the rays of a pass: its box, or all batches that have pixels in it. `instance` is its index, and the
/// part of the rays.
pub(super) fn draw(pass: &mut TrackedRenderPass, rays: RaysOf, props: &ViewProps, prop: &DrawnProp, instance: u32) {
    let vertices = match rays {
        RaysOf::Grid => 0..BOX_VERTICES,
        RaysOf::Batches => {
            if prop.rect.is_empty() {
                return;
            }
            let view = props.view.get();
            let (low, high) = (prop.rect.min / batch_side(view.spacing), batches(prop.rect.max, view.spacing));
            let (corner, size) = (low * BATCH, (high - low) * BATCH);
            pass.set_scissor_rect(corner.x, corner.y, size.x, size.y);
            let of_row = 6 * batches(view.size, view.spacing).x;
            low.y * of_row..high.y * of_row
        }
    };
    pass.draw(vertices, instance..instance + 1);
}
