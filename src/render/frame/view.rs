//! A view that draws props.

use bevy::{prelude::*, render::render_resource::BindGroup};

#[cfg(feature = "shadows")]
use super::slot::Slot;
use super::{bind_groups::BindGroups, buffers::ViewBuffers, cache::Cache, pass::Pass, textures::Textures};
#[cfg(feature = "shadows")]
use crate::render::shades::Shades;
use crate::{
    gpu::{LeftOut, ViewTooLarge},
    render::plan::Plan,
};

/// A view that draws props: the plan of its frame, the passes that follow from it, and what they need.
#[derive(Component, Default)]
pub(crate) struct PropView {
    pub(in crate::render) plan: Plan,
    /// The passes in the order in which they run.
    pub(in crate::render) passes: Vec<Pass>,
    /// What is left out because a pipeline is not ready.
    pub(in crate::render) left_out: LeftOut,
    /// For how many frames it has been drawn as before, because pipelines are not ready.
    pub(in crate::render) held_frames: u32,
    /// Whether the plan was drawn, or is about to be. Bevy skips cameras of windows that have no size.
    pub(in crate::render) is_drawn: bool,
    pub(in crate::render) textures: Textures,
    pub(in crate::render) buffers: ViewBuffers,
    pub(in crate::render) groups: BindGroups,
    pub(in crate::render) cached: Cache,
    /// Bind group 0 of passes that read Bevy's lights, and its offsets.
    pub(in crate::render) lights: Option<(BindGroup, Vec<u32>)>,
    #[cfg(feature = "shadows")]
    pub(in crate::render) shades: Shades,
    /// What determines the memory that it needs, when there was too little.
    pub(in crate::render) shortage: Option<(ViewTooLarge, usize)>,
}

impl PropView {
    /// Returns what there is too little memory for.
    #[cfg(feature = "headless")]
    pub fn shortage(&self) -> Option<&ViewTooLarge> {
        self.shortage.as_ref().map(|(error, _)| error)
    }

    /// Returns the props that are drawn, as entities of the main world.
    #[cfg(feature = "shadows")]
    pub(in crate::render) fn drawn_props(&self) -> impl Iterator<Item = Entity> {
        let draws_layer = |pass: &&Pass| pass.writes.iter().any(|slot| matches!(slot, Slot::Color(_)));
        let draws = self.passes.iter().filter(draws_layer).flat_map(|pass| &pass.draws);
        draws.filter_map(|draw| Some(draw.prop_of(&self.plan)?.entity))
    }

    /// Lets the view draw nothing in this frame, and forgets what it drew.
    pub(in crate::render) fn clear(&mut self) {
        self.plan = default();
        self.passes.clear();
        self.textures.clear();
        self.cached = default();
        self.left_out = LeftOut::Nothing;
    }
}
