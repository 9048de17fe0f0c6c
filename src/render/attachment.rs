//! Attachments of render passes.

use bevy::{
    prelude::*,
    render::render_resource::{
        CompareFunction, DepthStencilState, LoadOp, Operations, RenderPassColorAttachment,
        RenderPassDepthStencilAttachment, StoreOp, TextureFormat, TextureView,
    },
};

/// A color attachment that keeps the pixels that are not drawn.
pub(super) fn kept(view: &TextureView) -> Option<RenderPassColorAttachment<'_>> {
    Some(color(view, LoadOp::Load))
}

/// A color attachment that begins with zeros.
pub(super) fn cleared(view: &TextureView) -> Option<RenderPassColorAttachment<'_>> {
    Some(color(view, LoadOp::Clear(default())))
}

/// A color attachment.
pub(super) fn color(view: &TextureView, load: LoadOp<wgpu::Color>) -> RenderPassColorAttachment<'_> {
    RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: Operations { load, store: StoreOp::Store },
    }
}

/// A depth attachment that begins with zeros: infinitely far.
pub(super) fn cleared_depth(view: &TextureView) -> RenderPassDepthStencilAttachment<'_> {
    RenderPassDepthStencilAttachment {
        view,
        depth_ops: Some(Operations { load: LoadOp::Clear(0.0), store: StoreOp::Store }),
        stencil_ops: None,
    }
}

/// How a pipeline tests and writes depth. Nearer depths are greater.
pub(super) fn depth_test(format: TextureFormat, writes: bool, compare: CompareFunction) -> DepthStencilState {
    DepthStencilState {
        format,
        depth_write_enabled: Some(writes),
        depth_compare: Some(compare),
        stencil: default(),
        bias: default(),
    }
}
