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

/// A buffer and its content.
#[derive(Default)]
pub(in crate::render) struct Content {
    bytes: Vec<u8>,
    next: Vec<u8>,
    buffer: Option<Buffer>,
    hash: u64,
}

impl Content {
    /// Sets the content, and writes it to the buffer if it is new.
    pub fn set<T: ShaderType + WriteInto>(
        &mut self,
        device: &RenderDevice,
        queue: &RenderQueue,
        label: &'static str,
        usage: BufferUsages,
        value: &T,
    ) {
        self.next.clear();
        if encase::StorageBuffer::new(&mut self.next).write(value).is_err() {
            return;
        }
        if self.next == self.bytes && self.buffer.is_some() {
            return;
        }
        std::mem::swap(&mut self.bytes, &mut self.next);
        self.hash = FixedHasher.hash_one(&self.bytes);
        let size = self.bytes.len() as u64;
        match &self.buffer {
            // The size of an array is that of its buffer.
            Some(buffer) if buffer.size() == size => queue.write_buffer(buffer, 0, &self.bytes),
            _ => {
                let usage = usage | BufferUsages::COPY_DST;
                let buffer = device.create_buffer(&BufferDescriptor {
                    label: Some(label),
                    size,
                    usage,
                    mapped_at_creation: false,
                });
                queue.write_buffer(&buffer, 0, &self.bytes);
                self.buffer = Some(buffer);
            }
        }
    }

    /// Forgets the content, so that it is written again.
    pub fn forget(&mut self) {
        self.bytes.clear();
    }

    /// Returns a number that is different for different contents.
    pub fn hash(&self) -> u64 {
        self.hash
    }

    /// Returns the buffer, if it has been written.
    pub fn binding(&self) -> Option<BindingResource<'_>> {
        self.buffer.as_ref().map(|buffer| buffer.as_entire_binding())
    }
}
