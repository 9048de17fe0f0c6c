//! What a view keeps.

use bevy::{
    prelude::*,
    render::render_resource::{BindingResource, ShaderType, UniformBuffer},
};

use super::{
    copy::SceneCopy,
    key::{CompositeKey, Kept, LabelsKey, LayerKey},
    part::KeptPart,
};
use crate::render::bind_group::{KeptBindGroup, PerMainTexture};

/// Matches `Stale` in `view.wgsl`.
#[derive(ShaderType, Clone, Copy, Default)]
pub(in crate::render) struct StaleUniform {
    pub(super) layer: u32,
    pub(super) composite: u32,
    pub(super) labels: u32,
}

/// What a view keeps.
#[derive(Component, Default)]
pub(in crate::render) struct KeptView {
    pub layer: Kept<LayerKey>,
    pub composite: Kept<CompositeKey>,
    pub labels: Kept<LabelsKey>,
    pub(super) stale: Option<UniformBuffer<StaleUniform>>,
    /// The depth of the scene, and its colors.
    pub(super) copies: [Option<SceneCopy>; 2],
    pub(super) groups: CompareGroups,
}

/// The bind groups of the compare pass: for each of the two textures of a copy.
#[derive(Default)]
pub(super) struct CompareGroups {
    pub(super) depths: [KeptBindGroup; 2],
    pub(super) colors: PerMainTexture<[KeptBindGroup; 2]>,
}

impl KeptView {
    /// Returns whether a part is drawn even if the scene has not changed. Each part is made from the ones before it.
    pub fn is_drawn(&self, part: KeptPart) -> bool {
        match part {
            KeptPart::Layer => self.layer.is_drawn(),
            KeptPart::Composite => self.is_drawn(KeptPart::Layer) || self.composite.is_drawn(),
            KeptPart::Labels => self.is_drawn(KeptPart::Composite) || self.labels.is_drawn(),
        }
    }

    /// Returns the flags that tell shaders what must be drawn.
    pub fn stale(&self) -> Option<BindingResource<'_>> {
        self.stale.as_ref()?.binding()
    }
}
