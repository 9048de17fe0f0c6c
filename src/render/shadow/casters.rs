//! The props that cast shadows, in the main world.

use bevy::{
    camera::{
        primitives::{Aabb, CascadesFrusta, CubemapFrusta, Frustum, Sphere},
        visibility::{NoFrustumCulling, RenderLayers, SetViewVisibility, VisibilityRange, VisibleEntityRanges},
    },
    ecs::entity::EntityHashMap,
    light::NotShadowCaster,
    math::{Affine3A, Vec3A},
    prelude::*,
    render::{Extract, sync_world::RenderEntity},
};

use crate::{prop::Prop, quality::PropQuality};

/// The part of the scene that casts shadows into one shadow map.
pub(super) struct LightVolume {
    frustum: Frustum,
    layers: RenderLayers,
    /// The range of a point or spot light. `None` for directional lights.
    reach: Option<Sphere>,
}

impl LightVolume {
    fn contains(&self, bounds: &Aabb, transform: &Affine3A) -> bool {
        self.reach.is_none_or(|reach| reach.intersects_obb(bounds, transform))
            && self.frustum.intersects_obb(bounds, transform, self.reach.is_some(), true)
    }
}

type Light<'a, T, F> = (&'a T, &'a F, &'a GlobalTransform, Option<&'a RenderLayers>, &'a ViewVisibility);

/// Makes the props that a light sees visible, as Bevy does with meshes: props that no camera sees cast shadows as well.
pub(super) fn show_casters(
    mut volumes: Local<Vec<LightVolume>>,
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
    volumes.clear();
    let (suns, lamps, spots) = queries.p0();
    for (light, cascades, _, layers, visibility) in &suns {
        if light.shadow_maps_enabled && visibility.get() {
            volumes.extend(cascades.frusta.values().flatten().map(|frustum| seen(frustum, layers, None)));
        }
    }
    for (light, faces, transform, layers, visibility) in &lamps {
        if light.shadow_maps_enabled && visibility.get() {
            let reach = reach(transform, light.range);
            volumes.extend(faces.iter().map(|frustum| seen(frustum, layers, Some(reach))));
        }
    }
    for (light, frustum, transform, layers, visibility) in &spots {
        if light.shadow_maps_enabled && visibility.get() {
            volumes.push(seen(frustum, layers, Some(reach(transform, light.range))));
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
        if volumes.iter().any(|volume| {
            volume.layers.intersects(layers) && bounds.is_none_or(|bounds| volume.contains(bounds, &transform))
        }) {
            visibility.set_visible();
        }
    }
}

fn seen(frustum: &Frustum, layers: Option<&RenderLayers>, reach: Option<Sphere>) -> LightVolume {
    LightVolume { frustum: *frustum, layers: layers.cloned().unwrap_or_default(), reach }
}

fn reach(light: &GlobalTransform, range: f32) -> Sphere {
    Sphere { center: Vec3A::from(light.translation()), radius: range }
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
