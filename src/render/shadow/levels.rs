//! Finds the props in every shadow map, and chooses their levels.

use bevy::{
    camera::{
        primitives::{Aabb, Frustum},
        visibility::RenderLayers,
    },
    pbr::{ExtractedPointLight, LightEntity, Shadow, ShadowView},
    prelude::*,
    render::{
        render_asset::RenderAssets, render_phase::ViewBinnedRenderPhases, renderer::RenderDevice, view::ExtractedView,
    },
};
use glam::DVec4;

use super::{
    casters::Casters,
    maps::{Caster, MapProps},
    texels::{LightView, map_size},
};
use crate::{
    gpu::{GpuField, MAX_PROPS_IN_VIEW},
    prop::SolidOpacity,
    quality::PropQuality,
    render::{extract::ExtractedProps, rays::Pose},
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
    device: Res<RenderDevice>,
    mut maps: Query<(&ExtractedView, &Frustum, &LightEntity, &RenderLayers, &mut MapProps), With<ShadowView>>,
) {
    for (view, frustum, light, layers, mut map) in &mut maps {
        let size = map_size(view, &device);
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
        // The near plane of a sun's map is infinitely far away, and the far plane of a lamp's is at its range.
        let is_lamp = reach.is_finite();
        let may_have = |pose: &Pose| {
            let world_from_box = pose.box_from_world().inverse().as_affine3a();
            frustum.intersects_obb(&Aabb::from_min_max(Vec3::ZERO, Vec3::ONE), &world_from_box, true, is_lamp)
        };
        let in_layers = casters.props.iter().filter(|(_, of_prop)| of_prop.intersects(layers));
        map.order.extend(in_layers.filter_map(|(entity, _)| {
            let index = extracted.drawn(*extracted.index.get(entity)?, &fields)?;
            let prop = extracted.props.get(index).filter(|prop| prop.solid != SolidOpacity::Never)?;
            // For most props of a scene with many lights, rays need not be computed.
            if !may_have(&prop.pose) {
                return None;
            }
            let seen = LightView::new(&prop.pose, view, size).filter(|seen| is_in(seen, view, reach))?;
            let level = prop.pose.level(seen.rays.cell_size, quality);
            fields.get_mut(prop.field)?.request(level);
            Some(Caster { entity: *entity, index, level })
        }));
        map.order.truncate(MAX_PROPS_IN_VIEW);
    }
}

/// Returns whether a prop is in a map and within the range of the light.
fn is_in(seen: &LightView, view: &ExtractedView, reach: f64) -> bool {
    let nearest = view.clip_from_view.as_dmat4() * DVec4::new(0.0, 0.0, -seen.near, 1.0);
    seen.near < reach && nearest.z > 0.0 && !seen.on_map().is_empty()
}
