//! A ray against the props of an app.

use bevy::{ecs::system::SystemParam, prelude::*};
use glam::DMat3;
use plenoctree::{PlenOctree, palette::PaletteLabel};

use crate::{
    palette::Palettes,
    posterize::{MAX_BLEND_STEPS, Posterize},
    prop::{Prop, world_from_field},
};

/// Where a ray meets a prop. Everything is in the scene's world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PropHit {
    /// The prop.
    pub entity: Entity,
    /// Where the opacity along the ray reaches one half.
    pub point: Vec3,
    /// Distance of that point from the ray's origin.
    pub distance: f32,
    /// The direction in which opacity falls off around the point, smoothed over a few cells.
    pub normal: Dir3,
    /// The color of the field as trained, as it is seen along the whole ray.
    pub color: Srgba,
    /// Opacity along the whole ray, one half to 1.
    pub opacity: f32,
    /// The label in which this color is shown; `None` if the prop is not posterized, or has no palette yet, or if the
    /// opacity is under [`Posterize::min_opacity`]. Found without the filter that flattens a picture's colors first
    /// ([`Posterize::filter`]), so that at the border of two regions it can be the other one's.
    pub label: Option<PaletteLabel>,
}

/// Casts rays at props, from any system: what is aimed at, what is walked on, which region is to be recolored. Props are
/// hit where the opacity along the ray reaches one half, and not at all where it does not.
///
/// Works with the fields and transforms of the main world, so that it needs neither a GPU nor a camera. Transforms are
/// those of the last frame unless the system runs after Bevy's `TransformSystems::Propagate`. For events of pointers add
/// `PropPickingPlugin` (feature `picking`).
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_plenoctree::{Palettes, Prop, PropRayCast};
/// # #[derive(Component)] struct Sight;
/// fn shoot(
///     sights: Query<&GlobalTransform, With<Sight>>,
///     props: Query<&Prop>,
///     ray_cast: PropRayCast,
///     mut palettes: ResMut<Palettes>,
/// ) {
///     for sight in &sights {
///         let Some(hit) = ray_cast.cast_ray(Ray3d::new(sight.translation(), sight.forward())) else { continue };
///         // Whatever was hit turns red, and everything of its color.
///         if let (Ok(prop), Some(label)) = (props.get(hit.entity), hit.label)
///             && let Some(palette) = palettes.get_mut(&prop.0)
///         {
///             palette.set(label.main_color(), Color::srgb(0.9, 0.1, 0.1));
///         }
///     }
/// }
/// ```
#[derive(SystemParam)]
pub struct PropRayCast<'w, 's> {
    fields: Res<'w, Assets<PlenOctree>>,
    palettes: Res<'w, Palettes>,
    props: Query<
        'w,
        's,
        (Entity, &'static Prop, Option<&'static Posterize>, &'static GlobalTransform, &'static InheritedVisibility),
    >,
}

impl PropRayCast<'_, '_> {
    /// The nearest hit of all props that are not hidden, in view of a camera or not.
    pub fn cast_ray(&self, ray: Ray3d) -> Option<PropHit> {
        let shown = self.props.iter().filter(|(.., visibility)| visibility.get()).map(|(entity, ..)| entity);
        self.cast_ray_among(ray, shown).into_iter().next()
    }

    /// The hits of these entities, the nearest first; hidden or not. Those that are no props, or whose fields are not
    /// there yet, are not hit.
    pub fn cast_ray_among(&self, ray: Ray3d, entities: impl IntoIterator<Item = Entity>) -> Vec<PropHit> {
        let mut hits: Vec<_> = entities.into_iter().filter_map(|entity| self.hit(ray, entity)).collect();
        hits.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        hits
    }

    fn hit(&self, ray: Ray3d, entity: Entity) -> Option<PropHit> {
        let (_, prop, look, transform, _) = self.props.get(entity).ok()?;
        let field = self.fields.get(&prop.0)?;
        let world_from_field = world_from_field(transform, field.up());
        if !world_from_field.matrix3.determinant().is_normal() {
            return None;
        }
        let field_from_world = world_from_field.inverse();
        let direction = field_from_world.transform_vector3(ray.direction.as_dvec3());
        // Lengths of the field a length of the scene: depth is measured in the field's own units, however it is scaled.
        let scale = direction.length();
        let hit = field.cast_ray(field_from_world.transform_point3(ray.origin.as_dvec3()), direction / scale)?;

        let shown = look.filter(|look| hit.opacity >= f64::from(look.min_opacity)).zip(self.palettes.get(&prop.0));
        let [red, green, blue] = hit.color.as_vec3().to_array();
        Some(PropHit {
            entity,
            point: world_from_field.transform_point3(hit.point).as_vec3(),
            distance: (hit.distance / scale) as f32,
            normal: world_normal(field_from_world.matrix3, hit.normal).unwrap_or(-ray.direction),
            color: Srgba::rgb(red, green, blue),
            opacity: hit.opacity as f32,
            label: shown.and_then(|(look, palette)| {
                PaletteLabel::nearest(hit.color, palette.source(), look.blend_steps.min(MAX_BLEND_STEPS))
            }),
        })
    }
}

/// Normals turn with the transposed inverse, so that they stay upright on what is scaled unevenly.
fn world_normal(field_from_world: DMat3, normal: glam::DVec3) -> Option<Dir3> {
    let normal = (field_from_world.transpose() * normal).try_normalize()?;
    Dir3::new(normal.as_vec3()).ok()
}
