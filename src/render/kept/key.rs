//! Every reason to draw something again.

use bevy::{
    camera::CompositingSpace,
    prelude::*,
    render::render_resource::{BindGroupId, TextureViewId},
};

use crate::{
    render::view::{Overlap, PropUniform, ViewUniform},
    stage::PropStage,
};

/// Everything that a view's layer depends on, besides the depth of the scene.
#[derive(Default, PartialEq)]
pub(in crate::render) struct LayerKey {
    /// The viewport, the projection, the part that is drawn, temporal jitter, and the quality of rays.
    pub view: ViewUniform,
    /// The props in drawing order: how the camera sees them, where they were in the previous frame, the boxes around
    /// their leaves, their tints, where they are solid, and which pixels they own.
    pub props: Vec<PropUniform>,
    /// For each prop: its field at a level, if that is on the GPU, how it overlaps others, and whether lights fall on
    /// it.
    pub fields: Vec<(Option<BindGroupId>, Overlap, bool)>,
    /// The number of samples per pixel of the scene.
    pub samples: u32,
    /// The textures that hold the layer and all that it is made of. A view may get different ones in any frame.
    pub textures: Vec<TextureViewId>,
}

/// Everything that a view's filtered composite depends on, besides its layer and the colors of the scene.
#[derive(Default, PartialEq)]
pub(in crate::render) struct CompositeKey {
    /// The exposure, and whether the view is posterized.
    pub view: ViewUniform,
    /// The filters of the props and of the posterized view.
    pub props: Vec<PropUniform>,
    /// The color space of the view's target.
    pub space: Option<CompositingSpace>,
    /// Where in the frame the scene's colors are read.
    pub stage: PropStage,
    /// The textures that hold the composite, if anything is posterized.
    pub textures: Vec<TextureViewId>,
}

/// Everything that the labels of a view depend on, besides the filtered composite.
#[derive(Default, PartialEq)]
pub(in crate::render) struct LabelsKey {
    /// How the props and the posterized view are posterized, their tints, and whether edges are smooth.
    pub props: Vec<PropUniform>,
    /// Their source colors and shown colors.
    pub colors: Vec<Vec4>,
    /// The number of samples per pixel of the target.
    pub samples: Option<u32>,
    /// The textures that hold what is shown.
    pub textures: Vec<TextureViewId>,
}

/// The key of something that is drawn when the key changes.
pub(in crate::render) trait Key: Default + PartialEq {
    /// Whether it shows the scene, so that changes of the scene must be detected.
    const SHOWS_SCENE: bool;
}

impl Key for LayerKey {
    const SHOWS_SCENE: bool = true;
}

impl Key for CompositeKey {
    const SHOWS_SCENE: bool = true;
}

impl Key for LabelsKey {
    const SHOWS_SCENE: bool = false;
}

/// Something that is drawn when its key changes.
#[derive(Default)]
pub(in crate::render) struct Kept<K> {
    /// The key of this frame.
    key: K,
    /// The key of the last frame that was drawn.
    drawn: K,
    /// Whether what was drawn in that frame still exists.
    exists: bool,
    /// Whether everything that is needed to draw it is available.
    is_complete: bool,
    /// Whether the scene of that frame was copied, if it shows the scene.
    is_copied: bool,
    plan: Plan,
}

/// What to do in a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Plan {
    /// Draw: the key has changed.
    #[default]
    Draw,
    /// Draw, and copy the scene: the key has not changed, and may not change in the next frame either.
    Copy,
    /// Compare the scene with its copy, and draw only if they differ, or if what it shows is drawn.
    Compare,
}

impl<K: Key> Kept<K> {
    /// Returns the key of this frame, for writing it.
    pub(super) fn key(&mut self) -> &mut K {
        &mut self.key
    }

    /// Decides what to do in this frame, after its key was written. `is_complete` says whether everything that is
    /// needed to draw and to compare is available, and `may_keep` whether what was drawn before may be kept at all.
    pub(super) fn decide(&mut self, is_complete: bool, may_keep: bool) {
        self.is_complete = is_complete;
        // Whatever is drawn differently now, even if incompletely, replaces what was kept.
        self.exists &= is_complete && may_keep && self.key == self.drawn;
        self.plan = match (self.exists, self.is_copied) {
            (false, _) => Plan::Draw,
            (true, false) => Plan::Copy,
            (true, true) => Plan::Compare,
        };
    }

    /// Begins the frame in which it is drawn, or compared.
    pub(super) fn begin(&mut self) {
        self.exists = false;
    }

    /// Ends that frame.
    pub(super) fn finish(&mut self) {
        std::mem::swap(&mut self.key, &mut self.drawn);
        self.exists = self.is_complete;
        self.is_copied = self.reads_scene() || !K::SHOWS_SCENE;
    }

    /// Returns whether the scene is compared with its copy, and becomes the next copy.
    pub(super) fn reads_scene(&self) -> bool {
        self.plan != Plan::Draw
    }

    /// Returns whether it is drawn even if the scene has not changed.
    pub fn is_drawn(&self) -> bool {
        self.plan != Plan::Compare
    }
}
