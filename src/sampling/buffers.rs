//! Creates buffers, unless there is too little memory.

use bevy::render::{
    render_resource::{Buffer, BufferUsages},
    renderer::{RenderDevice, RenderQueue},
};

use super::SamplingFailure;
use crate::gpu::Allocator;

pub(super) fn buffer(
    allocator: &mut Allocator,
    device: &RenderDevice,
    label: &'static str,
    size: u64,
    usage: BufferUsages,
) -> Result<Buffer, SamplingFailure> {
    allocator.buffer(device, label, size, usage).ok_or(SamplingFailure::TooLarge)
}

/// Returns a buffer with `contents`.
pub(super) fn storage(
    allocator: &mut Allocator,
    device: &RenderDevice,
    queue: &RenderQueue,
    label: &'static str,
    contents: &[u8],
) -> Result<Buffer, SamplingFailure> {
    let contents = if contents.is_empty() { &[0; 16] } else { contents };
    let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
    let buffer = buffer(allocator, device, label, contents.len() as u64, usage)?;
    let written = allocator.create(device, || queue.write_buffer(&buffer, 0, contents));
    written.map(|()| buffer).ok_or(SamplingFailure::TooLarge)
}
