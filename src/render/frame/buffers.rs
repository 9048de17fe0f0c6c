//! The buffers of a view: the uniforms of bind group 0, and what lights and fog need.

use bevy::{
    prelude::*,
    render::{
        render_resource::{BindingResource, BufferUsages},
        renderer::{RenderDevice, RenderQueue},
    },
};

use crate::gpu::WrittenBuffer;
use crate::render::plan::PlanValues;

/// The buffers of a view.
#[derive(Default)]
pub(in crate::render) struct ViewBuffers {
    pub view: WrittenBuffer,
    pub props: WrittenBuffer,
    pub screen: WrittenBuffer,
    pub filters: WrittenBuffer,
    pub labelings: WrittenBuffer,
    /// See `Cache::first_drawn`.
    pub first_drawn: WrittenBuffer,
    /// How lights fall on each prop.
    pub lit: WrittenBuffer,
    /// The color that each label shows in each band of light.
    pub shades: WrittenBuffer,
    /// Bevy's fog of a camera without any.
    pub no_fog: WrittenBuffer,
}

/// The palettes of all props and posterized views.
#[derive(Resource, Default)]
pub(in crate::render) struct PaletteBuffer(pub WrittenBuffer);

impl ViewBuffers {
    pub fn set(&mut self, device: &RenderDevice, queue: &RenderQueue, values: &PlanValues) {
        let storage = BufferUsages::STORAGE;
        self.view.set(device, queue, "plenoctree_view", BufferUsages::UNIFORM, &values.view);
        self.props.set(device, queue, "plenoctree_props", storage, &values.props);
        self.screen.set(device, queue, "plenoctree_screen", BufferUsages::UNIFORM, &values.screen);
        self.filters.set(device, queue, "plenoctree_filters", storage, &values.filters);
        self.labelings.set(device, queue, "plenoctree_labels", storage, &values.labelings);
        self.no_fog.set(device, queue, "plenoctree_no_fog", BufferUsages::UNIFORM, &[Vec4::ZERO; 5]);
    }

    /// Writes the first result that must be drawn. The GPU changes it, so it is written in every frame.
    pub fn set_first_drawn(&mut self, device: &RenderDevice, queue: &RenderQueue, first: u32) {
        let usage = BufferUsages::UNIFORM | BufferUsages::STORAGE;
        self.first_drawn.hash = 0;
        self.first_drawn.set(device, queue, "plenoctree_first_drawn", usage, &first);
    }

    /// Returns the bindings of bind group 0, if all have been written.
    pub fn bindings<'a>(&'a self, palettes: &'a PaletteBuffer) -> Option<Vec<BindingResource<'a>>> {
        let Self { view, props, screen, filters, labelings, first_drawn, .. } = self;
        let all = [view, props, screen, filters, labelings, &palettes.0, first_drawn];
        all.into_iter().map(WrittenBuffer::binding).collect()
    }
}
