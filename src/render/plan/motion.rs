//! How views and props have moved since the previous frame, for effects that reuse it.

use bevy::{
    core_pipeline::prepass::PreviousViewData,
    prelude::*,
    render::{camera::TemporalJitter, view::ExtractedView},
};
use glam::DMat4;

use crate::render::extract::ExtractedProp;

/// The projections with which a view draws this frame and drew the previous one.
pub(super) struct Motion {
    /// With the camera's temporal jitter.
    pub clip_from_view: Mat4,
    /// Removes the jitter.
    pub unjittered_from_clip: DMat4,
    world_from_clip: DMat4,
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
        let previous_clip_from_world = match previous {
            Some(previous) => previous.clip_from_world.as_dmat4(),
            None => unjittered * world_from_view.inverse(),
        };
        Self {
            clip_from_view,
            unjittered_from_clip: unjittered * jittered.inverse(),
            world_from_clip: world_from_view * jittered.inverse(),
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
