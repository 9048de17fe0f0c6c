//! What a user puts on an entity.

use std::any::TypeId;

use bevy::{
    camera::{
        primitives::Aabb,
        visibility::{self, VisibilityClass, VisibilitySystems},
    },
    ecs::{lifecycle::HookContext, world::DeferredWorld},
    prelude::*,
};

use glam::DAffine3;

use crate::{
    field::{PlenOctree, UpAxis},
    quality::Quality,
};

/// A radiance field in the scene.
///
/// The field stands where the entity's transform puts it, in its own world units, turned so that its up axis is y. How
/// large the entity is scaled does not change how dense the field looks, and highlights turn with it. Alone it is shown
/// as trained; add [`Posterize`] for the stylized look.
#[derive(Component, Clone, Debug, FromTemplate, Reflect)]
#[reflect(Component, Clone, Debug)]
#[require(SolidOpacity, Transform, Visibility, VisibilityClass)]
#[component(on_add = visibility::add_visibility_class::<Prop>, on_remove = leave_visibility_class)]
pub struct Prop(pub Handle<PlenOctree>);

/// Undoes what happened when the prop was added; else an entity to which it is added again would be seen twice.
fn leave_visibility_class(mut world: DeferredWorld, HookContext { entity, .. }: HookContext) {
    if let Some(mut classes) = world.get_mut::<VisibilityClass>(entity) {
        classes.retain(|class| *class != TypeId::of::<Prop>());
    }
}

/// Where a [`Prop`] is solid: it writes depth where its opacity along a pixel's ray reaches this share, for what is drawn
/// later or looks at the scene's depth. 0 to 1; half by default. Above 1 it writes none.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
pub struct SolidOpacity(pub f32);

impl Default for SolidOpacity {
    fn default() -> Self {
        Self(0.5)
    }
}

/// The most steps from one palette color to another.
pub const MAX_BLEND_STEPS: u32 = 8;
/// The most iterations that the bilateral filter can do.
pub const MAX_FILTER_ITERATIONS: u32 = 16;
/// The largest radius of the bilateral filter, in pixels.
pub const MAX_FILTER_RADIUS: u32 = 6;

/// The stylized look of a [`Prop`]: section 4 of the method.
///
/// Needs a palette in [`Palettes`](crate::Palettes), which is read or extracted when none is there; until it is ready the
/// prop is shown as trained. [`PaletteOverride`](crate::PaletteOverride) gives the entity colors of its own. On a camera
/// it is the look of a [`PosterizeView`](crate::PosterizeView).
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
pub struct Posterize {
    /// `d`: steps from one palette color to another; 1 makes labels of the palette colors alone. 1 to
    /// [`MAX_BLEND_STEPS`]; 3 by default.
    pub blend_steps: u32,
    /// `D`: distance in encoded RGB over which neighboring labels blend; 0 is a hard edge. 0 to 0.4 is useful; 0.2 by
    /// default.
    pub softness: f32,
    /// `lambda`: pixels whose opacity is lower are shown as trained. 0 to 1; 80/255 by default.
    pub min_opacity: f32,
    /// The filter that flattens colors before labels are assigned.
    pub abstraction: Abstraction,
}

impl Default for Posterize {
    fn default() -> Self {
        Self { blend_steps: 3, softness: 0.2, min_opacity: 80.0 / 255.0, abstraction: Abstraction::default() }
    }
}

/// A separable bilateral filter: section 4, step 2 of the method.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Default, Clone, Debug, PartialEq)]
pub struct Abstraction {
    /// How often it runs, horizontally and vertically each time. 0 (no filter) to [`MAX_FILTER_ITERATIONS`]; 4 by default.
    pub iterations: u32,
    /// Radius in pixels. 0 to [`MAX_FILTER_RADIUS`]; 2 by default.
    pub radius: u32,
    /// Spatial sigma in pixels. Positive; 3 by default.
    pub spatial_sigma: f32,
    /// Range sigma in CIELAB. Positive; 4.25 by default.
    pub range_sigma: f32,
}

impl Default for Abstraction {
    fn default() -> Self {
        Self { iterations: 4, radius: 2, spatial_sigma: 3.0, range_sigma: 4.25 }
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
            .register_type::<Posterize>()
            .register_type::<SolidOpacity>()
            .register_type::<Quality>()
            .add_systems(PostUpdate, update_bounds.in_set(VisibilitySystems::CalculateBounds));
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
