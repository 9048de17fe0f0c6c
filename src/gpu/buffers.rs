//! Buffers that are written when their content changes.

use std::hash::BuildHasher;

use bevy::{
    platform::hash::FixedHasher,
    render::{
        render_resource::{
            BindingResource, Buffer, BufferDescriptor, BufferUsages, ShaderType,
            encase::{self, internal::WriteInto},
        },
        renderer::{RenderDevice, RenderQueue},
    },
};

/// Creates a buffer with a value.
pub(crate) fn buffer_with<T: ShaderType + WriteInto>(
    device: &RenderDevice,
    queue: &RenderQueue,
    label: &'static str,
    usage: BufferUsages,
    value: &T,
) -> Buffer {
    let mut bytes = vec![];
    // Writing to a vector does not fail. The driver reports buffers without a size.
    _ = encase::StorageBuffer::new(&mut bytes).write(value);
    create(device, queue, label, usage, &bytes)
}

/// Creates a buffer with these bytes. Does not map it, as Bevy's own buffers do: that panics on a device that was lost.
fn create(
    device: &RenderDevice,
    queue: &RenderQueue,
    label: &'static str,
    usage: BufferUsages,
    bytes: &[u8],
) -> Buffer {
    let (size, usage) = (bytes.len() as u64, usage | BufferUsages::COPY_DST);
    let buffer = device.create_buffer(&BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false });
    queue.write_buffer(&buffer, 0, bytes);
    buffer
}

/// A buffer and its content.
#[derive(Default)]
pub(crate) struct WrittenBuffer {
    bytes: Vec<u8>,
    buffer: Option<Buffer>,
    /// A number that is different for different contents.
    pub hash: u64,
}

impl WrittenBuffer {
    /// Sets the content, and writes it to the buffer if it is new.
    pub fn set<T: ShaderType + WriteInto>(
        &mut self,
        device: &RenderDevice,
        queue: &RenderQueue,
        label: &'static str,
        usage: BufferUsages,
        value: &T,
    ) {
        self.bytes.clear();
        if encase::StorageBuffer::new(&mut self.bytes).write(value).is_err() {
            return;
        }
        let before = std::mem::replace(&mut self.hash, FixedHasher.hash_one(&self.bytes));
        let size = self.bytes.len() as u64;
        match &self.buffer {
            Some(_) if before == self.hash => {}
            // The size of an array is that of its buffer.
            Some(buffer) if buffer.size() == size => queue.write_buffer(buffer, 0, &self.bytes),
            _ => self.buffer = Some(create(device, queue, label, usage, &self.bytes)),
        }
    }

    /// Returns the buffer, if it has been written.
    pub fn binding(&self) -> Option<BindingResource<'_>> {
        self.buffer.as_ref().map(|buffer| buffer.as_entire_binding())
    }
}
