//! Components for cameras: where in the frame props are drawn, and whether the whole view is posterized.

use bevy::{asset::AsAssetId, ecs::VariantDefaults, prelude::*, shader::Shader};

use plenoctree::PlenOctree;

use crate::posterize::Posterize;

/// Determines where in a camera's frame props are drawn and [`PosterizeView`] takes effect.
///
/// Add it to an entity with a `Camera3d`. Defaults to [`PropPlacement::Scene`].
///
/// ```
/// # use bevy::{prelude::*, shader::Shader};
/// # use bevy_plenoctree::PropPlacement;
/// fn spawn_camera(mut commands: Commands) {
///     commands.spawn((Camera3d::default(), PropPlacement::Display));
/// }
/// # App::new().add_systems(Startup, spawn_camera).update();
/// ```
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect, VariantDefaults)]
#[reflect(Component, Default, Clone, Debug, PartialEq, Hash)]
#[type_path = "bevy_plenoctree"]
pub enum PropPlacement {
    /// Draws props after opaque objects and the sky, and before objects that transmit light and transparent ones. This
    /// is the default.
    ///
    /// Props are emissive; transparent objects blend correctly in front of and behind them, and objects with
    /// `specular_transmission` refract them. Temporal jitter, motion vectors and the depth of the prepass include their
    /// solid parts, for temporal antialiasing and motion blur. At Bevy's default [`Exposure`], a display shows a prop's
    /// colors as they are. Any other `Exposure` brightens or darkens props as much as lit meshes, and with `Hdr`,
    /// bloom, tonemapping and other effects change them like everything else.
    ///
    /// [`Exposure`]: bevy::camera::Exposure
    #[default]
    Scene,
    /// Draws props after tonemapping and all other effects, below the UI. Palette colors reach the screen exactly,
    /// regardless of `Hdr`, `Tonemapping`, bloom, dithering and exposure. Temporal jitter does not move props.
    ///
    /// Opaque meshes still occlude props. Transparent objects are drawn again, blended over props, in every `AlphaMode`
    /// as in the scene, but without tonemapping. Those behind solid parts are hidden. Props cover objects with
    /// `specular_transmission`. Depth is written at this point as well, so depth of field, fog,
    /// temporal antialiasing and other effects do not see it. Cameras whose main pass has a different resolution
    /// (`MainPassResolutionOverride`) draw their props at [`Self::Scene`] instead.
    Display,
}

/// Posterizes everything that a camera sees with the palette of one field: meshes, the sky, and props without a
/// [`Posterize`].
///
/// Add it to an entity with a `Camera3d`. All pixels that no posterized prop owns are filtered and labeled as described
/// in section 4 of the method, in the shown colors of the field's palette in [`Palettes`](crate::Palettes). If the
/// field has no palette, one is loaded or extracted, as for a [`Prop`](crate::Prop); no prop has to show the field.
///
/// The camera's own [`Posterize`] holds the settings; its `min_opacity`, `before_palette` and `edges` are ignored.
/// Remove the `Posterize` to turn the effect off. Add a [`PaletteOverride`](crate::PaletteOverride) to the camera to
/// change the shown colors of this view only.
///
/// At [`PropPlacement::Scene`], the effect covers everything that is drawn before the transparent pass. At
/// [`PropPlacement::Display`], it covers everything below the UI.
///
/// ```
/// # use bevy::{prelude::*, shader::Shader};
/// # use bevy_plenoctree::{PlenOctreePlugin, Posterize, PosterizeView, PropPlacement};
/// fn spawn_camera(mut commands: Commands, assets: Res<AssetServer>) {
///     let view = (PosterizeView(assets.load("toadstool.plenoctree")), Posterize { softness: 0.1, ..default() });
///     commands.spawn((Camera3d::default(), PropPlacement::Display, view));
/// }
/// # let mut app = App::new();
/// # app.add_plugins((MinimalPlugins, AssetPlugin::default(), PlenOctreePlugin)).add_systems(Update, spawn_camera);
/// # app.update();
/// ```
#[derive(Component, Clone, Debug, PartialEq, Eq, FromTemplate, Reflect)]
#[reflect(Component, Clone, Debug, PartialEq)]
#[type_path = "bevy_plenoctree"]
#[require(Posterize)]
pub struct PosterizeView(pub Handle<PlenOctree>);

impl From<Handle<PlenOctree>> for PosterizeView {
    fn from(field: Handle<PlenOctree>) -> Self {
        Self(field)
    }
}

impl AsAssetId for PosterizeView {
    type Asset = PlenOctree;

    fn as_asset_id(&self) -> AssetId<PlenOctree> {
        self.0.id()
    }
}

/// Custom render stages between the labels and the screen: fragment shaders that change what is shown.
///
/// Add it to an entity with a `Camera3d`. The shaders run in order. Each has an entry point `fragment` that returns the
/// new color of a pixel at `@location(0)`, and reads two textures. The pixels of all three are those of its
/// `@builtin(position)`:
///
/// - `@group(1) @binding(0) var colors: texture_2d<f32>`: the colors so far, in encoded sRGB, and opacity. Opacity is
///   negative where nothing is drawn.
/// - `@group(1) @binding(1) var labels: texture_2d<u32>`: Red is 0 where nothing is drawn, 1 where a prop is drawn as
///   trained, and otherwise 2 plus the [index of the nearest label](plenoctree::palette::PaletteLabel::index). Green is
///   1 plus the index of the posterized prop among the view's props, sorted from back to front, or 0 if there is no such
///   prop. Both are those of the center of a pixel. At the edge of a prop, its colors are blended with what is behind
///   ([`EdgeSmoothing`](crate::EdgeSmoothing)); labels are not.
///
/// The textures hold the part of the view that props cover, and may be larger: `bevy_plenoctree::view::view.size` is
/// the size of the part, and `view.corner` the pixel of the target where it begins. Stages are left
/// out until their shaders are loaded, and also if one cannot be parsed or imports something that does not exist. A
/// shader whose entry point, bindings or output differ from the above causes a rendering error; by default, Bevy then
/// quits the app.
///
/// ```
/// # use bevy::{prelude::*, shader::Shader};
/// # use bevy_plenoctree::LabelStages;
/// fn spawn_camera(mut commands: Commands, assets: Res<AssetServer>) {
///     commands.spawn((Camera3d::default(), LabelStages(vec![assets.load("ink.wgsl")])));
/// }
/// # let mut app = App::new();
/// # app.add_plugins((MinimalPlugins, AssetPlugin::default())).init_asset::<Shader>();
/// # app.add_systems(Startup, spawn_camera).update();
/// ```
#[derive(Component, Clone, Debug, Default, FromTemplate, Reflect)]
#[reflect(Component, Default, Clone, Debug)]
#[type_path = "bevy_plenoctree"]
pub struct LabelStages(#[template(built_in)] pub Vec<Handle<Shader>>);
