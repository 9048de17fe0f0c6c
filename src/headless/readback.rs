//! Reading a texture back from the GPU.

use std::time::Duration;

use bevy::{
    prelude::*,
    render::{
        RenderApp,
        render_asset::RenderAssets,
        render_resource::{
            BufferDescriptor, BufferUsages, CommandEncoderDescriptor, MapMode, PollType, TexelCopyBufferInfo,
            TexelCopyBufferLayout,
        },
        renderer::{RenderDevice, RenderQueue},
        texture::GpuImage,
    },
};
use image::RgbaImage;

use super::error::HeadlessError;

/// Waits for the GPU, for at most `patience`, and returns the pixels of an 8-bit RGBA image.
pub(super) fn read(app: &App, handle: &Handle<Image>, patience: Duration) -> Result<RgbaImage, HeadlessError> {
    let failed = |reason: &str| HeadlessError::Readback(reason.into());
    let world = app.get_sub_app(RenderApp).ok_or_else(|| failed("there is no render world"))?.world();
    let device = world.resource::<RenderDevice>();
    let image =
        world.resource::<RenderAssets<GpuImage>>().get(handle).ok_or_else(|| failed("the target is not on the GPU"))?;
    let size = image.texture.size();
    let row = RenderDevice::align_copy_bytes_per_row(size.width as usize * 4);
    let buffer = device.create_buffer(&BufferDescriptor {
        label: Some("plenoctree_readback"),
        size: (row * size.height as usize) as u64,
        usage: BufferUsages::MAP_READ | BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor::default());
    let layout = TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row as u32), rows_per_image: None };
    encoder.copy_texture_to_buffer(
        image.texture.as_image_copy(),
        TexelCopyBufferInfo { buffer: &buffer, layout },
        size,
    );
    world.resource::<RenderQueue>().submit([encoder.finish()]);

    let (sender, receiver) = std::sync::mpsc::channel();
    buffer.slice(..).map_async(MapMode::Read, move |result| {
        // The receiver is dropped only if polling fails below, which returns its own error.
        let _ = sender.send(result);
    });
    let wait = PollType::Wait { submission_index: None, timeout: Some(patience) };
    device.poll(wait).map_err(|error| failed(&error.to_string()))?;
    receiver.recv().map_err(|_| failed("the buffer was not mapped"))?.map_err(|error| failed(&error.to_string()))?;
    let mapped = buffer.slice(..).get_mapped_range();
    let pixels = mapped.chunks_exact(row).flat_map(|line| &line[..size.width as usize * 4]).copied().collect();
    RgbaImage::from_raw(size.width, size.height, pixels).ok_or_else(|| failed("the buffer has the wrong size"))
}
