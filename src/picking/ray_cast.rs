//! Ray casts against props.

use bevy::{ecs::system::SystemParam, prelude::*};
use glam::DMat3;
use plenoctree::{PlenOctree, palette::PaletteLabel};

use crate::{
    palette::Palettes,
    posterize::Posterize,
    prop::{DrawnField, Prop, world_from_field},
};

/// A hit of a ray on a prop. Positions, distances and directions are in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PropHit {
    /// The entity with the [`Prop`].
    pub entity: Entity,
    /// The point where the opacity along the ray reaches one half.
    pub point: Vec3,
    /// The distance from the ray's origin to the point.
    pub distance: f32,
    /// The direction in which opacity decreases around the point, smoothed over a few cells. If it does not decrease in
    /// any direction, this is the direction back along the ray.
    pub normal: Dir3,
    /// The color along the whole ray as trained, in encoded sRGB, divided by its opacity.
    pub color: Srgba,
    /// The opacity along the whole ray, from 0.5 to 1.
    pub opacity: f32,
    /// The label nearest to the color, or `None` if the prop is not posterized, has no palette yet, still shows its
    /// previous field, or if its opacity is below [`Posterize::min_opacity`].
    ///
    /// It is found without the bilateral filter ([`Posterize::filter`]), so it can differ from the label on screen at
    /// the border of two regions.
    pub label: Option<PaletteLabel>,
}

/// A system parameter that casts rays at props, for example to find what the player aims at, what a character stands
/// on, or which region to recolor. A ray hits a prop where the opacity along it reaches one half, and misses if it
/// never does.
///
/// Uses the fields and transforms of the main world, so it needs neither a GPU nor a camera. Transforms are those of
/// the last frame, unless the system runs after Bevy's `TransformSystems::Propagate`. Props can be hit as soon as their
/// fields are loaded, even if [`PropState`](crate::PropState) says that they are not drawn yet. Hidden props are not
/// hit. Apps without Bevy's `DefaultPlugins` need its `TransformPlugin`, and `VisibilityPlugin` or an
/// `InheritedVisibility::VISIBLE` on each prop. A prop that was given another field is hit where its previous one is,
/// as long as that is drawn. For pointer events, add `PropPickingPlugin` (feature `picking`).
///
/// This parameter reads [`Palettes`], so a system that uses it cannot change them. Pipe its hits into another system:
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_plenoctree::{Palettes, PlenOctreePlugin, Prop, PropHit, PropRayCast};
/// # #[derive(Component)] struct Sight;
/// // Add both to a schedule: `app.add_systems(Update, aim.pipe(paint))`.
/// fn aim(sights: Query<&GlobalTransform, With<Sight>>, casts: PropRayCast) -> Option<PropHit> {
///     let sight = sights.iter().next()?;
///     casts.cast_ray(Ray3d::new(sight.translation(), sight.forward()))
/// }
///
/// // Recolors everything that has the same palette color as the point that was hit.
/// fn paint(In(hit): In<Option<PropHit>>, props: Query<&Prop>, mut palettes: ResMut<Palettes>) {
///     if let Some(hit) = hit
///         && let (Some(label), Ok(prop)) = (hit.label, props.get(hit.entity))
///         && let Some(palette) = palettes.get_mut(&prop.0)
///     {
///         palette.set(label.main_color(), Color::srgb(0.9, 0.1, 0.1));
///     }
/// }
/// # let mut app = App::new();
/// # app.add_plugins((MinimalPlugins, AssetPlugin::default(), PlenOctreePlugin)).add_systems(Update, aim.pipe(paint));
/// # app.update();
/// ```
#[derive(SystemParam)]
pub struct PropRayCast<'w, 's> {
    fields: Res<'w, Assets<PlenOctree>>,
    palettes: Res<'w, Palettes>,
    props: Query<
        'w,
        's,
        (
            Entity,
            (&'static Prop, &'static DrawnField),
            Option<&'static Posterize>,
            &'static GlobalTransform,
            &'static InheritedVisibility,
        ),
    >,
}

impl PropRayCast<'_, '_> {
    /// Returns the nearest hit on any prop that is not hidden, whether or not a camera sees it.
    pub fn cast_ray(&self, ray: Ray3d) -> Option<PropHit> {
        let visible = self.props.iter().filter(|(.., visibility)| visibility.get()).map(|(entity, ..)| entity);
        self.cast_ray_among(ray, visible).into_iter().next()
    }

    /// Returns the hits on the given entities, hidden or not, nearest first. Ignores entities that are not props or
    /// whose fields are not loaded yet.
    pub fn cast_ray_among(&self, ray: Ray3d, entities: impl IntoIterator<Item = Entity>) -> Vec<PropHit> {
        let mut hits: Vec<_> = entities.into_iter().filter_map(|entity| self.hit(ray, entity)).collect();
        hits.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        hits
    }

    fn hit(&self, ray: Ray3d, entity: Entity) -> Option<PropHit> {
        let (_, (prop, drawn), posterize, transform, _) = self.props.get(entity).ok()?;
        let stand_in = drawn.stand_in(&prop.0).and_then(|field| self.fields.get(field));
        let field = stand_in.or_else(|| self.fields.get(&prop.0))?;
        let world_from_field = world_from_field(transform, field.up());
        if !world_from_field.matrix3.determinant().is_normal() {
            return None;
        }
        let field_from_world = world_from_field.inverse();
        let direction = field_from_world.transform_vector3(ray.direction.as_dvec3());
        // Field units per world unit. Optical depth is measured in field units, regardless of the scale of the prop.
        let scale = direction.length();
        let hit = field.cast_ray(field_from_world.transform_point3(ray.origin.as_dvec3()), direction / scale)?;

        let posterize = posterize
            .map(|posterize| posterize.clamped())
            .filter(|posterize| hit.opacity >= f64::from(posterize.min_opacity));
        // Labels are those of the prop's own field.
        let posterized = posterize.zip(self.palettes.get(&prop.0)).filter(|_| stand_in.is_none());
        let [red, green, blue] = hit.color.as_vec3().to_array();
        Some(PropHit {
            entity,
            point: world_from_field.transform_point3(hit.point).as_vec3(),
            distance: (hit.distance / scale) as f32,
            normal: world_normal(field_from_world.matrix3, hit.normal).unwrap_or(-ray.direction),
            color: Srgba::rgb(red, green, blue),
            opacity: hit.opacity as f32,
            label: posterized.and_then(|(posterize, palette)| {
                let palette = palette.palette();
                PaletteLabel::nearest(hit.color, palette, posterize.blend_steps_of(palette))
            }),
        })
    }
}

/// Transforms a normal to world space by the inverse transpose, which keeps it perpendicular under non-uniform scale.
fn world_normal(field_from_world: DMat3, normal: glam::DVec3) -> Option<Dir3> {
    let normal = (field_from_world.transpose() * normal).try_normalize()?;
    Dir3::new(normal.as_vec3()).ok()
}
