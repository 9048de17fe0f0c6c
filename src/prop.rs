//! Props: fields placed in the scene.

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

use crate::sets::PlenOctreeSystems;

/// A radiance field in the scene.
///
/// The field stands where the entity's transform puts it, in its own world units, turned so that its up axis is y. How
/// large the entity is scaled does not change how dense the field looks, and highlights turn with it. Alone it is shown
/// as trained; add [`Posterize`](crate::Posterize) for the stylized look.
#[derive(Component, Clone, Debug, FromTemplate, Reflect)]
#[reflect(Component, Clone, Debug)]
#[type_path = "bevy_plenoctree"]
#[require(SolidOpacity, Transform, Visibility, VisibilityClass)]
#[component(on_add = visibility::add_visibility_class::<Prop>, on_remove = leave_visibility_class)]
pub struct Prop(pub Handle<PlenOctree>);

/// Undoes what happened when the prop was added; else an entity to which it is added again would be seen twice.
fn leave_visibility_class(mut world: DeferredWorld, HookContext { entity, .. }: HookContext) {
    if let Some(mut classes) = world.get_mut::<VisibilityClass>(entity) {
        classes.retain(|class| *class != TypeId::of::<Prop>());
    }
}

/// The opacity at which a [`Prop`] is solid, which is where it writes depth.
///
/// A ray that reaches this opacity writes the depth at which it does, so that whatever is drawn later, or reads the scene's
/// depth, treats the prop as a surface there.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
#[type_path = "bevy_plenoctree"]
pub enum SolidOpacity {
    /// Solid where the opacity along a pixel's ray reaches this value, from 0 to 1; values beyond are clamped. One half by
    /// default.
    At(f32),
    /// Never solid: the prop writes no depth.
    Never,
}

impl Default for SolidOpacity {
    fn default() -> Self {
        Self::At(0.5)
    }
}

/// From a field's own frame to the scene, for a prop that stands at `transform`.
pub(crate) fn world_from_field(transform: &GlobalTransform, up: UpAxis) -> DAffine3 {
    transform.affine().as_daffine3() * DAffine3::from_mat3(up.to_y_up())
}

/// Keeps the bounds of props.
pub(crate) struct PropPlugin;

impl Plugin for PropPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<Prop>()
            .register_type::<SolidOpacity>()
            .add_systems(PostUpdate, update_bounds.in_set(PlenOctreeSystems::UpdateBounds));
    }
}

/// Gives props the box around their leaves, for culling, when their field arrives or changes.
fn update_bounds(
    mut commands: Commands,
    fields: Res<Assets<PlenOctree>>,
    mut events: MessageReader<AssetEvent<PlenOctree>>,
    props: Query<(Entity, Ref<Prop>, Has<Aabb>)>,
) {
    // Empty in most frames, and then nothing is allocated.
    let changed: Vec<_> = events
        .read()
        .filter_map(|event| match event {
            AssetEvent::Added { id } | AssetEvent::Modified { id } => Some(*id),
            _ => None,
        })
        .collect();
    for (entity, prop, has_bounds) in &props {
        if has_bounds && !prop.is_changed() && !changed.contains(&prop.0.id()) {
            continue;
        }
        if let Some(field) = fields.get(&prop.0)
            && let Some((low, high)) = field.bounds()
        {
            let turn = field.up().to_y_up();
            let (a, b) = ((turn * low).as_vec3(), (turn * high).as_vec3());
            commands.entity(entity).try_insert(Aabb::from_min_max(a.min(b), a.max(b)));
        }
    }
}
