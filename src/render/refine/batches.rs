//! The pixels that get rays of their own.

use bevy::{
    prelude::*,
    render::{
        render_resource::{BindingResource, Buffer, BufferDescriptor, BufferUsages},
        renderer::RenderDevice,
    },
};

use super::rays::{BATCH, batches_size};
use crate::render::view::{ViewProps, ViewTextures};

/// The batches of a view, in views that have them.
#[derive(Component, Default)]
pub(in crate::render) struct Batches(Option<Buffers>);

struct Buffers {
    size: UVec2,
    /// The number of pixels in each batch.
    counts: Buffer,
    /// The places of pixels in their squares.
    pixels: Buffer,
}

impl Batches {
    /// Returns the bindings of the numbers of pixels, and of the pixels.
    pub fn bindings(&self) -> Option<[BindingResource<'_>; 2]> {
        self.0.as_ref().map(|Buffers { counts, pixels, .. }| {
            [counts, pixels].map(|buffer| BindingResource::Buffer(buffer.as_entire_buffer_binding()))
        })
    }

    /// Returns the buffer with the numbers of pixels, which must be 0 when the interpolate pass begins.
    pub fn counts(&self) -> Option<&Buffer> {
        self.0.as_ref().map(|buffers| &buffers.counts)
    }
}

pub(super) fn prepare(device: Res<RenderDevice>, mut views: Query<(Option<&ViewTextures>, &ViewProps, &mut Batches)>) {
    for (textures, props, mut batches) in &mut views {
        if textures.is_none_or(|textures| textures.sparse.is_none()) || props.rect.is_empty() {
            batches.0 = None;
            continue;
        }
        let size = batches_size(props.view.get().size);
        if batches.0.as_ref().is_some_and(|buffers| buffers.size == size) {
            continue;
        }
        let buffer = |label, words: u32| {
            device.create_buffer(&BufferDescriptor {
                label: Some(label),
                size: 4 * u64::from(words),
                usage: BufferUsages::STORAGE | BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let pixels = size.element_product();
        batches.0 = Some(Buffers {
            size,
            counts: buffer("plenoctree_batch_counts", pixels / (BATCH * BATCH)),
            pixels: buffer("plenoctree_batch_pixels", pixels),
        });
    }
}
