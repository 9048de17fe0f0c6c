//! The buffers of a view: the uniforms of bind group 0, and what lights and fog need.

use bevy::{
    prelude::*,
    render::{
        render_resource::{BindingResource, BufferUsages},
        renderer::{RenderDevice, RenderQueue},
    },
};

use super::{content::Content, pass::StaleUniform};
use crate::render::plan::PlanValues;

/// The buffers of a view.
#[derive(Default)]
pub(in crate::render) struct ViewBuffers {
    pub view: Content,
    pub props: Content,
    pub screen: Content,
    pub filters: Content,
    pub labelings: Content,
    pub stale: Content,
    /// How lights fall on each prop.
    pub lit: Content,
    /// The color that each label shows in each band of light.
    pub shades: Content,
    /// The camera's fog.
    pub fog: Content,
    /// A number that is different for different colors of the view's palettes.
    pub palettes: u64,
}

/// The palettes of all props and posterized views.
#[derive(Resource, Default)]
pub(in crate::render) struct PaletteBuffer(pub Content);

impl ViewBuffers {
    pub fn set(&mut self, device: &RenderDevice, queue: &RenderQueue, values: &PlanValues) {
        let storage = BufferUsages::STORAGE;
        self.view.set(device, queue, "plenoctree_view", BufferUsages::UNIFORM, &values.view);
        self.props.set(device, queue, "plenoctree_props", storage, &values.props);
        self.screen.set(device, queue, "plenoctree_screen", BufferUsages::UNIFORM, &values.screen);
        self.filters.set(device, queue, "plenoctree_filters", storage, &values.filters);
        self.labelings.set(device, queue, "plenoctree_labels", storage, &values.labelings);
        self.palettes = values.palettes;
    }

    /// Writes what must be drawn. The GPU changes it, so it is written in every frame.
    pub fn set_stale(&mut self, device: &RenderDevice, queue: &RenderQueue, stale: StaleUniform) {
        let usage = BufferUsages::UNIFORM | BufferUsages::STORAGE;
        self.stale.forget();
        self.stale.set(device, queue, "plenoctree_stale", usage, &stale);
    }

    /// Returns the bindings of bind group 0, if all have been written.
    pub fn bindings<'a>(&'a self, palettes: &'a PaletteBuffer) -> Option<Vec<BindingResource<'a>>> {
        let all = [&self.view, &self.props, &self.screen, &self.filters, &self.labelings, &palettes.0, &self.stale];
        all.into_iter().map(Content::binding).collect()
    }
}
