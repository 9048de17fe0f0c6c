//! Where in a camera's frame props are drawn, and what is posterized with them.

use bevy::prelude::*;

use plenoctree::PlenOctree;

use crate::posterize::Posterize;

/// Where in a camera's frame its props are drawn, and what [`PosterizeView`] posterizes with them.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_plenoctree::PropStage;
/// # fn spawn(mut commands: Commands) {
/// commands.spawn((Camera3d::default(), PropStage::Display));
/// # }
/// ```
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq, Hash)]
#[type_path = "bevy_plenoctree"]
pub enum PropStage {
    /// Among the scene's things, between the opaque and the transparent ones: what is transparent blends over the props
    /// and is hidden by them. The default.
    ///
    /// A prop counts as light: its colors are what it emits, as a display would show them at Bevy's default [`Exposure`].
    /// Another `Exposure` of the camera makes them lighter or darker by as much as lit meshes, and with `Hdr` bloom,
    /// tonemapping and other effects change them like everything else.
    ///
    /// [`Exposure`]: bevy::camera::Exposure
    #[default]
    Scene,
    /// After tonemapping and all other effects, below the user interface: colors of the palette reach the screen exactly,
    /// whatever `Hdr`, `Tonemapping`, bloom, dithering and exposure do to the rest.
    ///
    /// Opaque meshes still hide props, but what is transparent does not: props are drawn over it. Their depth is written
    /// then too, so that transparent things, depth of field, fog and other effects do not see it. A camera whose main pass
    /// has a resolution of its own (`MainPassResolutionOverride`) shows its props at [`Self::Scene`].
    Display,
}

/// Posterizes all that a camera sees in one field's palette: meshes, the sky, props without a [`Posterize`].
///
/// Pixels that no posterized prop owns get the filter and the labels of section 4 of the method, and the shown colors of
/// the field's palette in [`Palettes`](crate::Palettes), which is read or extracted when none is there, as for a
/// [`Prop`](crate::Prop); no prop need be in view. The camera's own [`Posterize`] is the look, without its `min_opacity`;
/// taking it away turns the view's off. A [`PaletteOverride`](crate::PaletteOverride) on the camera gives the view colors
/// of its own.
///
/// At [`PropStage::Scene`] it covers what is drawn before the transparent pass, at [`PropStage::Display`] everything below
/// the user interface.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_plenoctree::{Posterize, PosterizeView, PropStage};
/// # fn spawn(mut commands: Commands, assets: Res<AssetServer>) {
/// let look = Posterize { softness: 0.1, ..default() };
/// commands.spawn((Camera3d::default(), PropStage::Display, PosterizeView(assets.load("toadstool.npz")), look));
/// # }
/// ```
#[derive(Component, Clone, Debug, FromTemplate, Reflect)]
#[reflect(Component, Clone, Debug)]
#[type_path = "bevy_plenoctree"]
#[require(Posterize)]
pub struct PosterizeView(pub Handle<PlenOctree>);

/// On a camera: writes labels into textures, so that custom render stages can stand between the labels and the screen.
///
/// In the render world, the camera's view then has [`LabelTextures`](crate::LabelTextures). Systems in
/// [`PlenOctreeRenderSystems::LabelStages`](crate::PlenOctreeRenderSystems::LabelStages) of the `Core3d` schedule read and
/// rewrite them. Without this component there are no such textures, and labels are written straight to the screen.
#[derive(Component, Clone, Copy, Debug, Default, Reflect)]
#[reflect(Component, Default, Clone, Debug)]
#[type_path = "bevy_plenoctree"]
pub struct LabelStages;
