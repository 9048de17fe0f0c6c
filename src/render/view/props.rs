//! The props of one view, in GPU memory.

use bevy::{
    prelude::*,
    render::render_resource::{BindingResource, CachedRenderPipelineId, PipelineCache, StorageBuffer, UniformBuffer},
};
use plenoctree::PlenOctree;

use super::uniforms::{PropUniform, ViewUniform};
use crate::{gpu::Level, stage::PropStage};

/// The props of one view, back to front.
#[derive(Component, Default)]
pub(in crate::render) struct ViewProps {
    pub(super) order: Vec<OrderedProp>,
    /// The field of every prop, in the order in which they are drawn, and its level.
    pub fields: Vec<(AssetId<PlenOctree>, Level)>,
    /// The highest degree of spherical harmonics to evaluate.
    pub degree: u32,
    /// Whether fields may be drawn at other levels than their own.
    pub changes_levels: bool,
    /// Most iterations of the filter that a prop asks for.
    pub iterations: u32,
    /// The part of the viewport in which there is something to draw, and what the filter reads around it, in pixels.
    pub rect: URect,
    pub stage: PropStage,
    /// Whether labels go into textures of their own, for custom stages.
    pub has_stages: bool,
    /// The pipelines of the passes after the volume pass. None of these passes runs until all pipelines are ready.
    pub pipelines: Vec<CachedRenderPipelineId>,
    pub(super) view: UniformBuffer<ViewUniform>,
    /// After the props, what posterizes the rest of the view, if anything does.
    pub(super) props: StorageBuffer<Vec<PropUniform>>,
    pub(super) colors: StorageBuffer<Vec<Vec4>>,
}

/// A prop of a view, before it is placed.
pub(super) struct OrderedProp {
    /// How far along the view direction its middle is.
    pub distance: f64,
    /// Its place among the extracted props.
    pub index: usize,
    /// The level that the view asks for.
    pub level: Level,
}

impl ViewProps {
    /// What bind group 0 begins with; `None` if the view draws nothing.
    pub fn bindings(&self) -> Option<(BindingResource<'_>, BindingResource<'_>, BindingResource<'_>)> {
        if self.rect.is_empty() {
            return None;
        }
        Some((self.view.binding()?, self.props.binding()?, self.colors.binding()?))
    }

    /// Whether the passes after the volume pass can run at this place in the frame.
    pub fn posterizes_at(&self, stage: PropStage, cache: &PipelineCache) -> bool {
        self.stage == stage
            && !self.rect.is_empty()
            && self.pipelines.iter().all(|id| cache.get_render_pipeline(*id).is_some())
    }
}
