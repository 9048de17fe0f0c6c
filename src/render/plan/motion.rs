//! How views and props have moved since the previous frame, for effects that reuse it, and where props were in the
//! former frame of a view, so that pixels can keep their labels.

use bevy::{
    core_pipeline::prepass::PreviousViewData,
    ecs::entity::EntityHashMap,
    prelude::*,
    render::{camera::TemporalJitter, view::ExtractedView},
};
use glam::DMat4;
use plenoctree::PlenOctree;

use crate::render::{
    extract::ExtractedProp,
    uniforms::{FormerPlace, Rect},
};

/// The projections with which a view draws this frame and drew the previous one.
pub(super) struct Motion {
    /// With the camera's temporal jitter.
    pub clip_from_view: Mat4,
    /// Removes the jitter.
    pub unjittered_from_clip: DMat4,
    world_from_clip: DMat4,
    /// Without the jitter.
    unjittered_clip_from_world: DMat4,
    previous_clip_from_world: DMat4,
}

impl Motion {
    pub fn new(
        view: &ExtractedView,
        jitter: Option<&TemporalJitter>,
        previous: Option<&PreviousViewData>,
        viewport: UVec2,
    ) -> Self {
        let mut clip_from_view = view.clip_from_view;
        if let Some(jitter) = jitter {
            jitter.jitter_projection(&mut clip_from_view, viewport.as_vec2());
        }
        let world_from_view = DMat4::from(view.world_from_view.affine().as_daffine3());
        let (jittered, unjittered) = (clip_from_view.as_dmat4(), view.clip_from_view.as_dmat4());
        let unjittered_clip_from_world = unjittered * world_from_view.inverse();
        let previous_clip_from_world =
            previous.map_or(unjittered_clip_from_world, |previous| previous.clip_from_world.as_dmat4());
        Self {
            clip_from_view,
            unjittered_from_clip: unjittered * jittered.inverse(),
            world_from_clip: world_from_view * jittered.inverse(),
            unjittered_clip_from_world,
            previous_clip_from_world,
        }
    }

    /// Returns the matrix from clip space to where a point of the prop was in the previous frame.
    pub fn previous_from_clip(&self, prop: &ExtractedProp) -> DMat4 {
        self.former_from_clip(self.previous_clip_from_world, &prop.previous, &prop.pose.world_from_prop)
    }

    /// Returns the matrix from clip space to where a point of a prop was in an earlier frame, with another projection,
    /// when the prop was at `before`.
    pub fn former_from_clip(&self, clip_from_world: DMat4, before: &GlobalTransform, now: &GlobalTransform) -> DMat4 {
        let matrix = |transform: &GlobalTransform| DMat4::from(transform.affine().as_daffine3());
        clip_from_world * matrix(before) * matrix(now).inverse() * self.world_from_clip
    }

    /// Returns the projection of this frame.
    pub fn clip_from_world(&self) -> DMat4 {
        self.world_from_clip.inverse()
    }
}

/// A view at rest shows what a single frame shows, after this many frames: things that physics moves rest between two
/// steps of it.
const RESTING_FRAMES: u32 = 10;

/// A frame whose labels and depth still exist.
#[derive(Clone)]
pub(in crate::render) struct Former {
    clip_from_world: DMat4,
    unjittered_clip_from_world: DMat4,
    rect: Rect,
    props: EntityHashMap<FormerProp>,
}

/// A prop whose labels may be kept.
#[derive(Clone)]
pub(super) struct FormerProp {
    /// 1 + its index among the props of the view.
    owner: u32,
    place: GlobalTransform,
    /// Its field, at any level.
    field: AssetId<PlenOctree>,
    /// A number that is different for other labels.
    labels: u64,
    /// For how many frames neither it nor the camera has moved.
    rested: u32,
    /// Where it was in the frame whose labels it keeps, if it keeps any.
    former: Option<FormerPlace>,
}

impl FormerProp {
    pub fn new(owner: u32, place: GlobalTransform, field: AssetId<PlenOctree>, labels: u64) -> Self {
        Self { owner, place, field, labels, rested: RESTING_FRAMES, former: None }
    }
}

impl Former {
    pub(super) fn new(motion: &Motion, rect: Rect, props: EntityHashMap<FormerProp>) -> Self {
        let unjittered_clip_from_world = motion.unjittered_clip_from_world;
        Self { clip_from_world: motion.clip_from_world(), unjittered_clip_from_world, rect, props }
    }

    /// Finds the props that keep labels: if anything in the view moves, those of the former frame, and otherwise those
    /// that the former frame kept. Returns whether it is the former frame.
    pub(super) fn follow(&mut self, former: &Self, motion: &Motion) -> bool {
        let same = |entity: &Entity, now: &FormerProp| {
            let before = former.props.get(entity);
            before.filter(|before| (before.field, before.labels) == (now.field, now.labels))
        };
        // A camera with jitter may rest, too.
        let turns = self.unjittered_clip_from_world != former.unjittered_clip_from_world;
        let has_moved = |(entity, now)| same(entity, now).is_some_and(|before| before.place != now.place);
        let moves = turns || self.rect != former.rect || self.props.iter().any(has_moved);
        for (entity, now) in &mut self.props {
            let Some(before) = same(entity, now) else { continue };
            now.rested = if turns || before.place != now.place { 0 } else { before.rested.saturating_add(1) };
            now.former = if now.rested >= RESTING_FRAMES {
                None
            } else if moves {
                let from_clip = former.rect.clip_from_viewport()
                    * motion.former_from_clip(former.clip_from_world, &before.place, &now.place)
                    * self.rect.viewport_from_clip();
                let from_clip = from_clip.as_mat4();
                Some(FormerPlace { from_clip, size: former.rect.size.as_vec2(), owner: before.owner })
            } else {
                before.former
            };
        }
        moves && self.keeps_labels()
    }

    /// Returns whether any prop keeps labels.
    pub(super) fn keeps_labels(&self) -> bool {
        self.props.values().any(|now| now.former.is_some())
    }

    /// Returns where a prop was in the frame whose labels it keeps.
    pub(super) fn former(&self, prop: Entity) -> Option<&FormerPlace> {
        self.props.get(&prop)?.former.as_ref()
    }
}
