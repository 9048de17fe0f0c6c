//! The props of one view, in GPU memory.

use bevy::{
    prelude::*,
    render::{
        render_asset::RenderAssets,
        render_resource::{BindingResource, CachedRenderPipelineId, PipelineCache, StorageBuffer, UniformBuffer},
    },
};
use plenoctree::PlenOctree;

use super::uniforms::{PropUniform, ViewUniform};
use crate::{
    gpu::{GpuField, GpuLevel, Level},
    stage::PropStage,
};

/// The props of one view, back to front.
#[derive(Component, Default)]
pub(in crate::render) struct ViewProps {
    pub(super) order: Vec<OrderedProp>,
    /// Every prop, in drawing order.
    pub drawn: Vec<DrawnProp>,
    /// Whether props may be drawn at levels other than the field itself.
    pub changes_levels: bool,
    /// The maximum number of filter iterations of any prop, or of the posterized view.
    pub iterations: u32,
    /// The part of the viewport to draw to, in pixels, including what the filter reads around the props.
    pub rect: URect,
    pub stage: PropStage,
    /// Whether labels are written to textures, for custom stages.
    pub has_stages: bool,
    /// The pipelines of the passes after the volume pass. None of these passes runs until all pipelines are ready.
    pub pipelines: Vec<CachedRenderPipelineId>,
    pub view: UniformBuffer<ViewUniform>,
    /// The props, followed by the posterized view, if there is one.
    pub props: StorageBuffer<Vec<PropUniform>>,
    pub colors: StorageBuffer<Vec<Vec4>>,
}

/// What is drawn of a prop.
pub(in crate::render) struct DrawnProp {
    pub field: AssetId<PlenOctree>,
    pub level: Level,
    pub overlap: Overlap,
    /// Its index in `ExtractedProps::props`, if the scene's lights fall on it.
    pub lit: Option<usize>,
    /// Whether its edges are smooth.
    pub smooths_edges: bool,
    /// The pixels of the viewport that its box can cover.
    pub rect: URect,
}

impl DrawnProp {
    /// Returns the level on the GPU.
    pub fn on_gpu<'a>(&self, fields: &'a RenderAssets<GpuField>) -> Option<&'a GpuLevel> {
        fields.get(self.field)?.level(self.level).map(AsRef::as_ref)
    }
}

/// Whether a prop may cover the same pixels as another one, in a view where one of the two may be solid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::render) enum Overlap {
    None,
    /// It may, but is never solid itself.
    Thin,
    /// It may, and may be solid.
    Solid,
}

/// A prop of a view, in drawing order.
pub(super) struct OrderedProp {
    /// The distance of its center along the view direction.
    pub distance: f64,
    /// Its index in `ExtractedProps::props`.
    pub index: usize,
    /// The level that the view requests.
    pub level: Level,
}

impl ViewProps {
    /// Lets the view draw nothing.
    pub fn clear(&mut self) {
        self.drawn.clear();
        self.rect = URect::EMPTY;
    }

    /// Returns the size of the view's viewport, in pixels, or `None` if the view draws nothing.
    pub fn viewport_size(&self) -> Option<UVec2> {
        (!self.rect.is_empty()).then(|| self.view.get().size)
    }

    /// Returns the first bindings of bind group 0, or `None` if the view draws nothing.
    pub fn bindings(&self) -> Option<(BindingResource<'_>, BindingResource<'_>, BindingResource<'_>)> {
        if self.rect.is_empty() {
            return None;
        }
        Some((self.view.binding()?, self.props.binding()?, self.colors.binding()?))
    }

    /// Returns whether the nearest solid prop of every pixel must be known before props are drawn.
    pub fn has_overlaps(&self) -> bool {
        self.drawn.iter().any(|prop| prop.overlap == Overlap::Solid)
    }

    /// Returns whether anything is posterized.
    pub fn posterizes(&self) -> bool {
        self.props.get().iter().any(PropUniform::is_posterized)
    }

    /// Returns whether the edges of any prop are smooth.
    pub fn smooths_edges(&self) -> bool {
        self.drawn.iter().any(|prop| prop.smooths_edges)
    }

    /// Returns whether the passes after the volume pass can run at this place in the frame.
    pub fn is_shown_at(&self, stage: PropStage, cache: &PipelineCache) -> bool {
        self.stage == stage
            && !self.rect.is_empty()
            && self.pipelines.iter().all(|id| cache.get_render_pipeline(*id).is_some())
    }
}
