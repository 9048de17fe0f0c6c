//! The gaps whose pixels get rays of their own.

use bevy::{
    prelude::*,
    render::{
        render_resource::{BindingResource, Buffer, BufferDescriptor, BufferUsages},
        renderer::RenderDevice,
    },
};

use super::rays::{MOST_GAPS, batches};
use crate::render::view::{ViewMemory, ViewProps, ViewTextures};

/// The batches of a view, in views that have them.
#[derive(Component, Default)]
pub(in crate::render) struct Batches(Option<Buffers>);

struct Buffers {
    /// The number of batches.
    len: u32,
    /// The number of gaps in each batch.
    counts: Buffer,
    /// The places of gaps in the squares of their batches.
    gaps: Buffer,
}

impl Batches {
    /// Returns the bindings of the numbers of gaps, and of the gaps.
    pub fn bindings(&self) -> Option<[BindingResource<'_>; 2]> {
        self.0.as_ref().map(|Buffers { counts, gaps, .. }| {
            [counts, gaps].map(|buffer| BindingResource::Buffer(buffer.as_entire_buffer_binding()))
        })
    }

    /// Returns the buffer with the numbers of gaps, which must be 0 when the check pass begins.
    pub fn counts(&self) -> Option<&Buffer> {
        self.0.as_ref().map(|buffers| &buffers.counts)
    }
}

pub(super) fn prepare(
    device: Res<RenderDevice>,
    mut views: Query<(Option<&ViewTextures>, &ViewProps, &mut ViewMemory, &mut Batches)>,
) {
    for (textures, props, mut memory, mut list) in &mut views {
        if textures.is_none_or(|textures| textures.sparse.is_none()) || props.rect.is_empty() {
            list.0 = None;
            continue;
        }
        let view = props.view.get();
        let len = batches(view.size, view.spacing).element_product();
        if list.0.as_ref().is_some_and(|buffers| buffers.len == len) {
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
        list.0 = memory.create(&device, || Buffers {
            len,
            counts: buffer("plenoctree_batch_counts", len),
            gaps: buffer("plenoctree_batch_gaps", len * MOST_GAPS),
        });
    }
}
