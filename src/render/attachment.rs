//! Attachments and depth tests of render passes.

use bevy::{
    prelude::*,
    render::render_resource::{
        CompareFunction, DepthStencilState, LoadOp, Operations, RenderPassColorAttachment,
        RenderPassDepthStencilAttachment, StoreOp, TextureFormat, TextureView,
    },
};

/// Returns a color attachment that keeps its previous contents.
pub(super) fn kept(view: &TextureView) -> Option<RenderPassColorAttachment<'_>> {
    Some(color(view, LoadOp::Load))
}

/// Returns a color attachment that is cleared to zero.
pub(super) fn cleared(view: &TextureView) -> Option<RenderPassColorAttachment<'_>> {
    Some(color(view, LoadOp::Clear(default())))
}

/// Returns a color attachment.
pub(super) fn color(view: &TextureView, load: LoadOp<wgpu::Color>) -> RenderPassColorAttachment<'_> {
    RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: Operations { load, store: StoreOp::Store },
    }
}

/// Returns a depth attachment that is cleared to zero, which is infinitely far (reverse z), or keeps its previous
/// contents.
pub(super) fn depth(view: &TextureView, clears: bool) -> RenderPassDepthStencilAttachment<'_> {
    let load = if clears { LoadOp::Clear(0.0) } else { LoadOp::Load };
    RenderPassDepthStencilAttachment {
        view,
        depth_ops: Some(Operations { load, store: StoreOp::Store }),
        stencil_ops: None,
    }
}

/// Returns a depth attachment that is only tested.
pub(super) fn tested(view: &TextureView) -> RenderPassDepthStencilAttachment<'_> {
    RenderPassDepthStencilAttachment { view, depth_ops: None, stencil_ops: None }
}

/// Returns the depth state of a pipeline. Nearer depths are greater (reverse z).
pub(super) fn depth_test(format: TextureFormat, writes: bool, compare: CompareFunction) -> DepthStencilState {
    DepthStencilState {
        format,
        depth_write_enabled: Some(writes),
        depth_compare: Some(compare),
        stencil: default(),
        bias: default(),
    }
}
