//! Finds the props in every shadow map, and chooses their levels.

use bevy::{
    camera::visibility::RenderLayers,
    pbr::{ExtractedPointLight, LightEntity, Shadow, ShadowView},
    prelude::*,
    render::{render_asset::RenderAssets, render_phase::ViewBinnedRenderPhases, view::ExtractedView},
};
use glam::{DMat4, DVec3, DVec4};

use super::{
    casters::Casters,
    maps::{Caster, MapProps},
    texels::LightView,
};
use crate::{
    gpu::{GpuField, MAX_PROPS_IN_VIEW},
    prop::SolidOpacity,
    quality::PropQuality,
    render::extract::ExtractedProps,
};

/// The quality of shadows of lights without their own: cells are no larger than texels.
const QUALITY: PropQuality = PropQuality { cell_size: 1.0, ..PropQuality::EXACT };

/// Finds the props in every map, and requests their levels.
pub(super) fn choose_levels(
    extracted: Res<ExtractedProps>,
    casters: Res<Casters>,
    mut fields: ResMut<RenderAssets<GpuField>>,
    phases: Option<Res<ViewBinnedRenderPhases<Shadow>>>,
    lamps: Query<&ExtractedPointLight>,
    mut maps: Query<(&ExtractedView, &LightEntity, &RenderLayers, &mut MapProps), With<ShadowView>>,
) {
    for (view, light, layers, mut map) in &mut maps {
        map.order.clear();
        // Lights that are out of view keep their maps, but Bevy does not draw them.
        if !phases.as_ref().is_some_and(|phases| phases.contains_key(&view.retained_view_entity)) {
            continue;
        }
        let (LightEntity::Directional { light_entity, .. }
        | LightEntity::Point { light_entity, .. }
        | LightEntity::Spot { light_entity }) = light;
        let quality = casters.qualities.get(light_entity).unwrap_or(&QUALITY);
        let reach = lamps.get(*light_entity).map_or(f64::INFINITY, |lamp| lamp.range.into());
        let sides = Sides::of(view);
        let in_layers = casters.props.iter().filter(|(_, of_prop)| of_prop.intersects(layers));
        map.order.extend(in_layers.filter_map(|(entity, _)| {
            let index = extracted.drawn(*extracted.index.get(entity)?, &fields)?;
            let prop = extracted.props.get(index).filter(|prop| prop.solid != SolidOpacity::Never)?;
            if sides.exclude(prop.pose.center(), prop.pose.radius(), reach) {
                return None;
            }
            let seen = LightView::new(&prop.pose, view).filter(|seen| is_in(seen, view, reach))?;
            let level = prop.pose.level(seen.rays.cell_size, quality);
            fields.get_mut(prop.field)?.request(level);
            Some(Caster { entity: *entity, index, level })
        }));
        map.order.truncate(MAX_PROPS_IN_VIEW);
    }
}

/// What bounds a map: where its light is, and the planes at its four sides, which face inward. They exclude most props
/// of a scene with many lights, for which rays would take a hundred times as long to compute.
struct Sides {
    light: DVec3,
    planes: [DVec4; 4],
}

impl Sides {
    fn of(view: &ExtractedView) -> Self {
        let world_from_view = DMat4::from(view.world_from_view.affine().as_daffine3());
        let clip_from_world = match view.clip_from_world {
            Some(clip_from_world) => clip_from_world.as_dmat4(),
            None => view.clip_from_view.as_dmat4() * world_from_view.inverse(),
        };
        let [x, y, w] = [0, 1, 3].map(|row| clip_from_world.row(row));
        Self { light: world_from_view.w_axis.truncate(), planes: [w + x, w - x, w + y, w - y] }
    }

    /// Returns whether no part of a ball is in the map and within the `reach` of the light.
    fn exclude(&self, center: DVec3, radius: f64, reach: f64) -> bool {
        let is_outside = |plane: &DVec4| plane.dot(center.extend(1.0)) < -radius * plane.truncate().length();
        center.distance(self.light) - radius > reach || self.planes.iter().any(is_outside)
    }
}

/// Returns whether a prop is in a map and within the range of the light.
fn is_in(seen: &LightView, view: &ExtractedView, reach: f64) -> bool {
    let nearest = view.clip_from_view.as_dmat4() * DVec4::new(0.0, 0.0, -seen.near, 1.0);
    seen.near < reach && nearest.z > 0.0 && !seen.on_map().is_empty()
}

#[cfg(test)]
mod tests {
    use bevy::render::{render_resource::TextureFormat, view::RetainedViewEntity};
    use plenoctree::{Frame, UpAxis};
    use proptest::prelude::*;

    use super::*;
    use crate::render::rays::Pose;

    proptest! {
        /// No prop is excluded that has a point in the map, but those out of reach are.
        #[test]
        fn no_sides_exclude_what_is_in_a_map(
            is_parallel in any::<bool>(),
            turn in prop::array::uniform3(-3.0f32..3.0),
            light in prop::array::uniform3(-5.0f32..5.0),
            place in prop::array::uniform3(-8.0f32..8.0),
            scale in prop::array::uniform3(0.1f32..2.0),
            reach in 0.5..20.0,
        ) {
            let [x, y, z] = turn;
            let world_from_view = Transform::from_translation(light.into())
                .with_rotation(Quat::from_euler(EulerRot::XYZ, x, y, z));
            let clip_from_view = match is_parallel {
                true => Mat4::orthographic_rh(-3.0, 3.0, -3.0, 3.0, 20.0, 0.1),
                false => Mat4::perspective_infinite_reverse_rh(1.5, 1.0, 0.1),
            };
            let clip_from_world = clip_from_view * world_from_view.to_matrix().inverse();
            let view = ExtractedView {
                retained_view_entity: RetainedViewEntity::new(Entity::PLACEHOLDER.into(), None, 0),
                clip_from_view,
                world_from_view: world_from_view.into(),
                clip_from_world: is_parallel.then_some(clip_from_world),
                target_format: TextureFormat::R8Unorm,
                viewport: UVec4::new(0, 0, 256, 256),
                color_grading: default(),
                invert_culling: false,
            };
            let transform = Transform::from_translation(place.into()).with_scale(scale.into());
            let pose = Pose {
                world_from_prop: transform.with_rotation(Quat::from_euler(EulerRot::ZYX, z, x, y)).into(),
                up: UpAxis::Z,
                frame: Frame { scale: DVec3::splat(0.5), offset: DVec3::splat(0.5) },
                low: DVec3::new(0.1, 0.2, 0.3),
                high: DVec3::new(0.9, 0.7, 0.8),
                cells: 256.0,
            };
            let reach = if is_parallel { f64::INFINITY } else { reach };
            let world_from_box = pose.box_from_world().inverse();
            let is_in_map = |index: u8| {
                let point = DVec3::new((index % 3).into(), (index / 3 % 3).into(), (index / 9).into()) / 2.0;
                let point = world_from_box.transform_point3(point);
                let clip = clip_from_world.as_dmat4() * point.extend(1.0);
                clip.w > 0.0
                    && clip.truncate().truncate().abs().max_element() < clip.w
                    && point.distance(Vec3::from(light).as_dvec3()) < reach
            };
            let is_excluded = Sides::of(&view).exclude(pose.center(), pose.radius(), reach);
            prop_assert!(!is_excluded || !(0..27).any(is_in_map));
            // No prop is as large as this.
            let is_far = pose.center().distance(Vec3::from(light).as_dvec3()) > reach + 5.0;
            prop_assert!(is_excluded || !is_far);
            // Behind the light of a face, or beside the map of a sun.
            let aside = if is_parallel { world_from_view.right() } else { world_from_view.back() };
            let center = (world_from_view.translation + 10.0 * aside).as_dvec3();
            prop_assert!(Sides::of(&view).exclude(center, 5.0, f64::INFINITY));
        }
    }
}
