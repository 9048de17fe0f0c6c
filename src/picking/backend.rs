//! A picking backend for props.

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

/// A plugin that adds a picking backend for props: pointers hit a [`Prop`] where the opacity along their ray reaches
/// one half.
///
/// Requires the feature `picking`, and Bevy's `DefaultPickingPlugins`, which `DefaultPlugins` includes with that
/// feature. Without them, logs an error, and no prop is picked.
///
/// Props are picked through every `Camera3d` that sees them, unless they are [`Pickable::IGNORE`]. The position and
/// normal of a hit are those of its [`PropHit`](crate::PropHit), which is attached as extra data:
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
#[derive(Clone, Copy, Debug, Default)]
pub struct PropPickingPlugin;

impl Plugin for PropPickingPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(PreUpdate, find_hits.in_set(PickingSystems::Backend).run_if(resource_exists::<RayMap>));
    }

    fn finish(&self, app: &mut App) {
        if !app.world().contains_resource::<RayMap>() {
            error!("no prop can be picked: `PropPickingPlugin` needs Bevy's `DefaultPickingPlugins`");
        }
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
        // A prop that emits no events can still block entities behind it, so skip only those that do neither.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::log::logged;

    #[test]
    fn without_picking_plugins_there_is_an_error_with_words() {
        let run = || {
            let mut app = App::new();
            app.add_plugins((MinimalPlugins, PropPickingPlugin)).finish();
            app.update();
        };
        let expected = "no prop can be picked: `PropPickingPlugin` needs Bevy's `DefaultPickingPlugins`\n";
        assert_eq!(logged(run), ((), expected.to_string()));
    }
}
