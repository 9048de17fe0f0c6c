//! Fullscreen passes: one triangle, with the view's bind group as bind group 0.

use bevy::{
    camera::Viewport,
    prelude::*,
    render::{
        render_phase::TrackedRenderPass,
        render_resource::{
            BindGroup, BindGroupLayoutDescriptor, BindGroupLayoutEntry, BlendState, ColorTargetState, ColorWrites,
            CompareFunction, DepthStencilState, FragmentState, RenderPipeline, RenderPipelineDescriptor, TextureFormat,
            VertexState,
        },
    },
    shader::{Shader, ShaderDefVal},
};

use super::{
    attachment::depth_test,
    kept::KeptPart,
    view::{DEPTH_FORMAT, ViewLayouts, ViewProps},
};
use crate::gpu::Shaders;

/// A pass that draws one triangle over the viewport.
pub(super) struct Fullscreen {
    pub label: &'static str,
    vertex: Handle<Shader>,
    /// The shader definitions of the vertex shader.
    vertex_defs: Vec<ShaderDefVal>,
    fragment: Handle<Shader>,
    view: BindGroupLayoutDescriptor,
    /// The layout of bind group 1.
    pub layout: BindGroupLayoutDescriptor,
}

impl Fullscreen {
    pub fn new(
        label: &'static str,
        fragment: &Handle<Shader>,
        entries: &[BindGroupLayoutEntry],
        shaders: &Shaders,
        views: &ViewLayouts,
    ) -> Self {
        Self {
            label,
            vertex: shaders.fullscreen.clone(),
            vertex_defs: vec![],
            fragment: fragment.clone(),
            view: views.plain.clone(),
            layout: BindGroupLayoutDescriptor::new(label, entries),
        }
    }

    /// Makes the pass draw nothing while `what` is kept from an earlier frame.
    pub fn unless_kept(self, what: KeptPart) -> Self {
        Self { vertex_defs: vec![what.definition()], ..self }
    }

    pub fn pipeline(&self, shader_defs: Vec<ShaderDefVal>, targets: &[ColorTargetState]) -> RenderPipelineDescriptor {
        RenderPipelineDescriptor {
            label: Some(self.label.into()),
            layout: vec![self.view.clone(), self.layout.clone()],
            vertex: VertexState {
                shader: self.vertex.clone(),
                shader_defs: self.vertex_defs.clone(),
                entry_point: Some("vertex".into()),
                ..default()
            },
            fragment: Some(FragmentState {
                shader: self.fragment.clone(),
                shader_defs,
                entry_point: Some("fragment".into()),
                targets: targets.iter().cloned().map(Some).collect(),
            }),
            ..default()
        }
    }
}

/// Returns the depth state of passes over the props' depth. Where no prop was drawn, the triangle fails this test, and
/// the fragment shader does not run.
pub(super) fn props_test() -> DepthStencilState {
    depth_test(DEPTH_FORMAT, false, CompareFunction::LessEqual)
}

/// Returns a color target for a pipeline.
pub(super) fn target(format: TextureFormat, blend: Option<BlendState>) -> ColorTargetState {
    ColorTargetState { format, blend, write_mask: ColorWrites::ALL }
}

/// Draws the triangle over the part of the viewport that the view draws to. `viewport` is the viewport within the
/// view's target, or `None` for the plugin's own textures, which have the size of the viewport.
pub(super) fn draw<'a>(
    pass: &mut TrackedRenderPass<'a>,
    props: &ViewProps,
    viewport: Option<&Viewport>,
    pipeline: &'a RenderPipeline,
    groups: [(&'a BindGroup, &[u32]); 2],
) {
    let mut corner = props.rect.min;
    if let Some(viewport) = viewport {
        pass.set_camera_viewport(viewport);
        corner += viewport.physical_position;
    }
    draw_part(pass, URect { min: corner, max: corner + props.rect.size() }, pipeline, groups);
}

/// Draws the triangle over a part of the target, in pixels.
pub(super) fn draw_part<'a>(
    pass: &mut TrackedRenderPass<'a>,
    part: URect,
    pipeline: &'a RenderPipeline,
    groups: [(&'a BindGroup, &[u32]); 2],
) {
    pass.set_scissor_rect(part.min.x, part.min.y, part.width(), part.height());
    pass.set_render_pipeline(pipeline);
    for (index, (group, offsets)) in groups.into_iter().enumerate() {
        pass.set_bind_group(index, group, offsets);
    }
    pass.draw(0..3, 0..1);
}
