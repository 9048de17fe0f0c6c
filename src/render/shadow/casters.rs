//! The props that cast shadows: finds them in the main world, and then in every shadow map, and chooses their levels.

use bevy::{
    camera::{
        primitives::{Aabb, CascadesFrusta, CubemapFrusta, Frustum},
        visibility::{NoFrustumCulling, RenderLayers, SetViewVisibility, VisibilityRange, VisibleEntityRanges},
    },
    ecs::entity::EntityHashMap,
    light::NotShadowCaster,
    pbr::{ExtractedPointLight, LightEntity, Shadow, ShadowView},
    prelude::*,
    render::{
        Extract, render_asset::RenderAssets, render_phase::ViewBinnedRenderPhases, renderer::RenderDevice,
        sync_world::RenderEntity, view::ExtractedView,
    },
};
use glam::DVec4;

use super::{
    maps::MapProps,
    texels::{LightView, map_size},
};
use crate::{
    gpu::{GpuField, MAX_PROPS_IN_VIEW},
    prop::{Prop, SolidOpacity},
    quality::PropQuality,
    render::{extract::ExtractedProps, rays::Pose},
};

/// The part of the scene that casts shadows into one shadow map.
struct LightVolume {
    frustum: Frustum,
    layers: RenderLayers,
    /// Whether it is that of a point or spot light. The sun is infinitely far away, so its volume has no near plane.
    is_lamp: bool,
}

type Light<'a, T, F> = (&'a T, &'a F, (Option<&'a RenderLayers>, &'a ViewVisibility));

/// Makes the props that a light sees visible, as Bevy does with meshes: props that no camera sees cast shadows as well.
pub(super) fn show_casters(
    mut queries: ParamSet<(
        (
            Query<Light<DirectionalLight, CascadesFrusta>>,
            Query<Light<PointLight, CubemapFrusta>>,
            Query<Light<SpotLight, Frustum>>,
        ),
        Query<
            (
                Entity,
                &InheritedVisibility,
                &mut ViewVisibility,
                Option<&RenderLayers>,
                Option<&Aabb>,
                &GlobalTransform,
                Has<NoFrustumCulling>,
                Has<VisibilityRange>,
            ),
            (With<Prop>, Without<NotShadowCaster>),
        >,
    )>,
    cameras: Query<Entity, With<Camera>>,
    ranges: Option<Res<VisibleEntityRanges>>,
) {
    let mut volumes = vec![];
    let (suns, lamps, spots) = queries.p0();
    let of_suns = suns.iter().map(|(light, cascades, of)| {
        (light.shadow_maps_enabled, cascades.frusta.values().flatten().collect::<Vec<_>>(), of, false)
    });
    let of_lamps = lamps.iter().map(|(light, faces, of)| (light.shadow_maps_enabled, faces.iter().collect(), of, true));
    let of_spots = spots.iter().map(|(light, frustum, of)| (light.shadow_maps_enabled, vec![frustum], of, true));
    for (has_maps, frusta, (layers, visibility), is_lamp) in of_suns.chain(of_lamps).chain(of_spots) {
        if has_maps && visibility.get() {
            let volume = |frustum: &Frustum| LightVolume {
                frustum: *frustum,
                layers: layers.cloned().unwrap_or_default(),
                is_lamp,
            };
            volumes.extend(frusta.into_iter().map(volume));
        }
    }
    if volumes.is_empty() {
        return;
    }
    for (entity, inherited, mut visibility, layers, bounds, transform, everywhere, ranged) in &mut queries.p1() {
        let in_range = || {
            let ranges = ranges.as_deref().filter(|_| ranged);
            ranges.is_none_or(|ranges| cameras.iter().any(|view| ranges.entity_is_in_range_of_view(entity, view)))
        };
        if !inherited.get() || visibility.get() || !in_range() {
            continue;
        }
        let (layers, transform) = (layers.unwrap_or_default(), transform.affine());
        let bounds = bounds.filter(|_| !everywhere);
        if volumes.iter().any(|LightVolume { frustum, layers: of_light, is_lamp }| {
            let contains = |bounds: &Aabb| frustum.intersects_obb(bounds, &transform, *is_lamp, true);
            of_light.intersects(layers) && bounds.is_none_or(contains)
        }) {
            visibility.set_visible();
        }
    }
}

/// The casters, in the render world.
#[derive(Resource, Default)]
pub(super) struct Casters {
    /// The props, as entities of the main world.
    pub props: Vec<(Entity, RenderLayers)>,
    /// The [`PropQuality`] of lights that have one, by their entities in the render world.
    pub qualities: EntityHashMap<PropQuality>,
}

pub(super) fn extract_casters(
    mut casters: ResMut<Casters>,
    props: Extract<Query<(Entity, Option<&RenderLayers>, &ViewVisibility), (With<Prop>, Without<NotShadowCaster>)>>,
    lights: Extract<
        Query<(RenderEntity, &PropQuality), Or<(With<DirectionalLight>, With<PointLight>, With<SpotLight>)>>,
    >,
) {
    casters.props.clear();
    let visible = props.iter().filter(|(.., visibility)| visibility.get());
    casters.props.extend(visible.map(|(entity, layers, _)| (entity, layers.cloned().unwrap_or_default())));
    casters.qualities.clear();
    casters.qualities.extend(lights.iter().map(|(light, quality)| (light, quality.clamped())));
}

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
            Some((index, level))
        }));
        map.order.truncate(MAX_PROPS_IN_VIEW);
    }
}

/// Returns whether a prop is in a map and within the range of the light.
fn is_in(seen: &LightView, view: &ExtractedView, reach: f64) -> bool {
    let nearest = view.clip_from_view.as_dmat4() * DVec4::new(0.0, 0.0, -seen.near, 1.0);
    seen.near < reach && nearest.z > 0.0 && !seen.on_map().is_empty()
}
