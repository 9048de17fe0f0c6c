//! Props: entities that place fields in the scene, and their states.

mod component;
mod drawn;
mod path;
mod progress;
mod state;

pub use component::{Prop, PropTint, SolidOpacity};
pub(crate) use drawn::DrawnField;
pub use path::PropPath;
pub use progress::PropProgress;
pub use state::{PropError, PropState};

use bevy::{
    camera::{
        primitives::Aabb,
        visibility::{NoAutoAabb, VisibilitySystems},
    },
    prelude::*,
};

use glam::DAffine3;
use plenoctree::{PlenOctree, UpAxis};

use crate::{
    gpu::{FieldReady, GpuStatus},
    sets::PlenOctreeSystems,
};

/// Returns the transform from the field's own frame to the scene's world space, for a prop at `transform`.
pub(crate) fn world_from_field(transform: &GlobalTransform, up: UpAxis) -> DAffine3 {
    transform.affine().as_daffine3() * DAffine3::from_mat3(up.to_y_up())
}

/// Registers [`Prop`] and keeps the bounds of props up to date.
pub(crate) struct PropPlugin;

impl Plugin for PropPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<Prop>()
            .register_type::<PropPath>()
            .register_type::<PropTint>()
            .register_type::<SolidOpacity>()
            .configure_sets(PostUpdate, PlenOctreeSystems::UpdateBounds.in_set(VisibilitySystems::CalculateBounds))
            .add_systems(PostUpdate, update_bounds.in_set(PlenOctreeSystems::UpdateBounds));
    }
}

/// Sets the [`Aabb`] of props to the bounds of their field's leaves, when the field is loaded, changed or drawn.
/// Includes the bounds of an earlier field, or an earlier version, that is still drawn.
fn update_bounds(
    mut commands: Commands,
    fields: Res<Assets<PlenOctree>>,
    mut events: MessageReader<AssetEvent<PlenOctree>>,
    mut arrivals: MessageReader<FieldReady>,
    gpu: Res<GpuStatus>,
    props: Query<(Entity, Ref<Prop>, Ref<DrawnField>, Option<&Aabb>), Without<NoAutoAabb>>,
) {
    // Usually empty, so most frames allocate nothing.
    let changed: Vec<_> = events
        .read()
        .filter_map(|event| match event {
            AssetEvent::Added { id } | AssetEvent::Modified { id } => Some(*id),
            _ => None,
        })
        .collect();
    let arrived: Vec<_> = arrivals.read().map(|ready| ready.field).collect();
    for (entity, prop, drawn, bounds) in &props {
        let id = prop.0.id();
        let (is_changed, has_arrived) = (changed.contains(&id), arrived.contains(&id));
        if bounds.is_some() && !prop.is_changed() && !drawn.is_changed() && !is_changed && !has_arrived {
            continue;
        }
        let earlier_version = bounds.filter(|_| is_changed && !has_arrived && gpu.has_reports());
        let earlier_version = earlier_version.map(|bounds| (bounds.min().into(), bounds.max().into()));
        let of_fields = [Some(&prop.0), drawn.stand_in(&prop.0)].into_iter().flatten();
        let of_fields = of_fields.filter_map(|field| bounds_of(fields.get(field)?));
        if let Some((low, high)) = of_fields.chain(earlier_version).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))) {
            commands.entity(entity).try_insert(Aabb::from_min_max(low, high));
        }
    }
}

/// Returns the bounds of a field's leaves in the frame of its props.
fn bounds_of(field: &PlenOctree) -> Option<(Vec3, Vec3)> {
    let (low, high) = field.bounds()?;
    let rotation = field.up().to_y_up();
    let (a, b) = ((rotation * low).as_vec3(), (rotation * high).as_vec3());
    Some((a.min(b), a.max(b)))
}
