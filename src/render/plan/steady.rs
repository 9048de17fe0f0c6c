//! Where props were in the former frame of a view, so that pixels can keep their labels.

use bevy::{ecs::entity::EntityHashMap, prelude::*, render::render_resource::BindGroupId};
use glam::DMat4;

use super::motion::Motion;
use crate::render::{
    extract::ExtractedProp,
    uniforms::{Earlier, Rect},
};

/// A frame whose labels and depth still exist.
#[derive(Clone)]
pub(in crate::render) struct Former {
    clip_from_world: DMat4,
    rect: Rect,
    props: EntityHashMap<FormerProp>,
}

/// A prop whose labels may be kept.
#[derive(Clone, PartialEq)]
pub(super) struct FormerProp {
    /// 1 + its index among the props of the view.
    pub owner: u32,
    pub place: GlobalTransform,
    /// The bind group of its field.
    pub field: BindGroupId,
    /// A number that is different for other labels.
    pub labels: u64,
}

impl Former {
    pub(super) fn new(motion: &Motion, rect: Rect, props: EntityHashMap<FormerProp>) -> Self {
        Self { clip_from_world: motion.clip_from_world(), rect, props }
    }

    /// Returns where a prop was, if it or the camera has moved since then, and nothing else has changed: a view at rest
    /// shows what a single frame shows.
    pub(super) fn earlier(
        &self,
        motion: &Motion,
        rect: &Rect,
        prop: &ExtractedProp,
        now: &FormerProp,
    ) -> Option<Earlier> {
        let former = self.props.get(&prop.entity)?;
        let moves = self.clip_from_world != motion.clip_from_world() || former.place != now.place;
        if !moves || (former.field, former.labels) != (now.field, now.labels) {
            return None;
        }
        let former_from_clip = self.rect.clip_from_viewport()
            * motion.earlier_from_clip(self.clip_from_world, &former.place, &now.place)
            * rect.viewport_from_clip();
        Some(Earlier {
            former_from_clip: former_from_clip.as_mat4(),
            size: self.rect.size.as_vec2(),
            owner: former.owner,
        })
    }
}
