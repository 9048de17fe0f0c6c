//! Pointers over props.

use std::any::TypeId;

use bevy::{
    camera::visibility::VisibleEntities,
    picking::{
        PickingSystems,
        backend::{HitData, PointerHits, ray::RayMap},
    },
    prelude::*,
};

use super::ray_cast::PropRayCast;
use crate::prop::Prop;

/// A backend for Bevy's picking: pointers meet a [`Prop`] where the opacity along their ray reaches one half. Needs the
/// feature `picking`, and Bevy's `DefaultPickingPlugins`, which `DefaultPlugins` have then.
///
/// Props are picked by the cameras that see them, unless they are [`Pickable::IGNORE`]d. Position and normal of a hit are
/// those of its [`PropHit`](crate::PropHit), which comes along as extra data:
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_plenoctree::{PaletteOverride, PropHit};
/// // For `commands.spawn((Prop(..), Posterize::default(), PaletteOverride::default())).observe(recolor)`.
/// fn recolor(click: On<Pointer<Click>>, mut colors: Query<&mut PaletteOverride>) {
///     let hit = click.hit.extra_as::<PropHit>();
///     if let (Ok(mut colors), Some(label)) = (colors.get_mut(click.entity), hit.and_then(|hit| hit.label)) {
///         colors.set(label.main_color(), Color::srgb(0.2, 0.4, 0.9));
///     }
/// }
/// ```
pub struct PropPickingPlugin;

impl Plugin for PropPickingPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(PreUpdate, find_hits.in_set(PickingSystems::Backend));
    }
}

fn find_hits(
    rays: Res<RayMap>,
    cameras: Query<(&Camera, &VisibleEntities), With<Camera3d>>,
    pickables: Query<&Pickable>,
    ray_cast: PropRayCast,
    mut hits: MessageWriter<PointerHits>,
) {
    for (id, ray) in rays.iter() {
        let Ok((camera, visible)) = cameras.get(id.camera) else {
            continue;
        };
        let candidates = visible.iter(TypeId::of::<Prop>()).copied();
        // Those that emit no events still hide what is behind them, unless they do neither.
        let candidates = candidates.filter(|entity| pickables.get(*entity).ok() != Some(&Pickable::IGNORE));
        let picks: Vec<_> = ray_cast
            .cast_ray_among(*ray, candidates)
            .into_iter()
            .map(|hit| {
                let (point, normal) = (Some(hit.point), Some(*hit.normal));
                (hit.entity, HitData::new_with_extra(id.camera, hit.distance, point, normal, hit))
            })
            .collect();
        if !picks.is_empty() {
            hits.write(PointerHits::new(id.pointer, picks, camera.order as f32));
        }
    }
}
