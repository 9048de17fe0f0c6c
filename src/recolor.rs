//! Recoloring props as trained.

use bevy::prelude::*;

use crate::posterize::{BeforePalette, Posterize};

/// Recolors a [`Prop`](crate::Prop) without posterizing it. The prop keeps its trained shading and texture, but its
/// colors follow changes of the palette: a photographed helmet takes on a team color and still looks like a photograph.
///
/// Each color is a weighted mix of nearby palette colors, and moves in Oklab as they do (section 4 of the method, step
/// 9). So textures stay, ramps meet without seams, and colors near which no palette color has changed stay the same,
/// bit for bit.
///
/// Uses the palette of the prop's field in [`Palettes`](crate::Palettes), with the
/// [`PaletteOverride`](crate::PaletteOverride) of the entity. If the field has no palette, one is loaded or extracted,
/// as for [`Posterize`]. A prop that also has a [`Posterize`] is posterized.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_plenoctree::{PaletteOverride, PlenOctreePlugin, Prop, Recolor};
/// fn spawn(mut commands: Commands, assets: Res<AssetServer>) {
///     let team = PaletteOverride::default().with_ramp("red", Color::srgb(0.2, 0.4, 0.9));
///     commands.spawn((Prop(assets.load("helmet.plenoctree")), Recolor::default(), team));
/// }
/// # let mut app = App::new();
/// # app.add_plugins((MinimalPlugins, AssetPlugin::default(), PlenOctreePlugin)).add_systems(Update, spawn);
/// # app.update();
/// ```
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
#[type_path = "bevy_plenoctree"]
pub struct Recolor {
    /// What is drawn until the palette is loaded or extracted.
    ///
    /// Defaults to [`BeforePalette::Hide`], so that the prop is never seen in its old colors.
    pub before_palette: BeforePalette,
}

/// Returns what is drawn of a prop until its palette is ready, or `None` if it needs none.
pub(crate) fn before_palette(posterize: Option<&Posterize>, recolor: Option<&Recolor>) -> Option<BeforePalette> {
    posterize.map(|posterize| posterize.before_palette).or(recolor.map(|recolor| recolor.before_palette))
}
