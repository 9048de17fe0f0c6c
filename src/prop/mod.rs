//! Props: entities that place fields in the scene, and their states.

mod drawn;
mod path;
mod progress;
mod state;

pub(crate) use drawn::DrawnField;
pub use path::PropPath;
pub use progress::PropProgress;
pub use state::{PropError, PropState};

use std::any::TypeId;

use bevy::{
    camera::{
        primitives::Aabb,
        visibility::{self, VisibilityClass},
    },
    ecs::{lifecycle::HookContext, world::DeferredWorld},
    prelude::*,
};

use glam::DAffine3;
use plenoctree::{PlenOctree, UpAxis};

use crate::{
    gpu::{FieldReady, GpuStatus},
    sets::PlenOctreeSystems,
};

/// Places a field in the scene.
///
/// The field is placed by the entity's [`Transform`], in the field's own world units, and rotated so that its up axis
/// becomes Bevy's y axis. Scaling the entity does not change the field's apparent density, and highlights rotate with
/// the entity. Scales from 1e-18 to 1e18 along each axis are supported: squares of larger lengths are not numbers in
/// float32. By default, the field is drawn as trained; add [`Posterize`](crate::Posterize) to posterize it.
///
/// [`PropState`] says whether the prop can be drawn yet, and [`PropProgress`] how close it is. If it is given another
/// field, the previous one is drawn until the new one can be.
#[derive(Component, Clone, Debug, FromTemplate, Reflect)]
#[reflect(Component, Clone, Debug)]
#[type_path = "bevy_plenoctree"]
#[require(DrawnField, PropProgress, PropState, PropTint, SolidOpacity, Transform, Visibility, VisibilityClass)]
#[component(on_add = visibility::add_visibility_class::<Prop>, on_remove = clean_up)]
pub struct Prop(pub Handle<PlenOctree>);

/// Reverts `add_visibility_class`. Otherwise, an entity whose [`Prop`] is removed and added again would be listed twice
/// as visible. Also releases the field.
fn clean_up(mut world: DeferredWorld, HookContext { entity, .. }: HookContext) {
    if let Some(mut classes) = world.get_mut::<VisibilityClass>(entity) {
        classes.retain(|class| *class != TypeId::of::<Prop>());
    }
    world.commands().entity(entity).try_remove::<(DrawnField, PropProgress, PropState)>();
}

/// Multiplies the light of a [`Prop`], for example to dim it with the scene at night. The scene's lights do not make
/// props brighter or darker, except through a `PropLighting` (feature `shadows`).
///
/// Applies to everything that is drawn of the prop: as trained, in the shown colors of its palette, and in those of its
/// [`PaletteOverride`](crate::PaletteOverride). Multiplies linear light, channel by channel, and does not change which
/// pixels get which label. Channels above 1 brighten: `PropTint(Color::linear_rgb(2.0, 2.0, 2.0))` adds one stop.
/// Negative channels count as 0. Alpha is ignored.
///
/// Defaults to white, which changes nothing.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
#[type_path = "bevy_plenoctree"]
pub struct PropTint(pub Color);

impl Default for PropTint {
    fn default() -> Self {
        Self(Color::WHITE)
    }
}

impl PropTint {
    /// Returns the factors of linear light.
    pub(crate) fn factors(self) -> Vec3 {
        // NaN counts as 0. The limit is that of half floats.
        let factor = |channel: f32| if channel > 0.0 { channel.min(65504.0) } else { 0.0 };
        self.0.to_linear().to_vec3().to_array().map(factor).into()
    }
}

/// The opacity at which a [`Prop`] counts as solid: from there on, it writes depth and casts shadows.
///
/// The pixel's depth is that of the point where the opacity along its ray reaches this value. Anything that is drawn
/// later or reads the scene's depth treats that point as a surface. Pixels whose opacity stays below it write no depth.
///
/// With the feature `shadows`, the same holds along the rays of a light: its shadow begins where the opacity reaches
/// this value, and parts whose opacity stays below it cast none.
///
/// Where several props overlap in the view, the depth is that of the nearest one that is solid. The nearest one that is
/// solid and lets no light through hides what is behind that point, and nothing in front of it. Without such a prop,
/// the nearest solid one decides what is drawn in front of and behind the others.
///
/// Defaults to `At(0.5)`.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
#[type_path = "bevy_plenoctree"]
pub enum SolidOpacity {
    /// The prop is solid where the opacity along a pixel's ray reaches this value. Clamped to 0..=1; with 0, it is
    /// solid wherever it is not empty.
    At(f32),
    /// The prop is never solid, writes no depth and casts no shadows.
    Never,
}

impl Default for SolidOpacity {
    fn default() -> Self {
        Self::At(0.5)
    }
}

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
    props: Query<(Entity, Ref<Prop>, Ref<DrawnField>, Option<&Aabb>)>,
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
