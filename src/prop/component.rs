//! The components of props: the field, and how it is drawn.

use std::any::TypeId;

use bevy::{
    asset::AsAssetId,
    camera::visibility::{self, VisibilityClass},
    ecs::{VariantDefaults, lifecycle::HookContext, world::DeferredWorld},
    prelude::*,
};
use plenoctree::PlenOctree;

use super::{drawn::DrawnField, progress::PropProgress, state::PropState};

/// Places a field in the scene.
///
/// By default, the field is drawn as trained; add [`Posterize`](crate::Posterize) to posterize it.
///
/// The entity's [`Transform`] places the field: one unit of the field is one unit of the world, and the field's up axis
/// becomes Bevy's y axis. Scaling the entity does not change how dense the field looks, and highlights rotate with the
/// entity. Scales from 1e-20 to 1e20 along each axis are supported.
///
/// [`PropState`] says whether the prop can be drawn yet, and [`PropProgress`] how close it is. If it is given another
/// field, the previous one is drawn until the new one can be. A prop with a default handle waits until it is given
/// another one.
///
/// To animate a field, load its frames as fields of their own, and give the prop one handle after the other. If a field
/// is replaced in [`Assets`] instead, its new version arrives from the start: one that is replaced again before it has
/// arrived is never drawn.
#[derive(Component, Clone, Debug, PartialEq, Eq, FromTemplate, Reflect)]
#[reflect(Component, Clone, Debug, PartialEq)]
#[type_path = "bevy_plenoctree"]
#[require(DrawnField, PropProgress, PropState, PropTint, SolidOpacity, Transform, Visibility, VisibilityClass)]
#[component(on_add = visibility::add_visibility_class::<Prop>, on_remove = clean_up)]
pub struct Prop(pub Handle<PlenOctree>);

impl From<Handle<PlenOctree>> for Prop {
    fn from(field: Handle<PlenOctree>) -> Self {
        Self(field)
    }
}

impl AsAssetId for Prop {
    type Asset = PlenOctree;

    fn as_asset_id(&self) -> AssetId<PlenOctree> {
        self.0.id()
    }
}

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
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect, VariantDefaults)]
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
