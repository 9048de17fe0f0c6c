//! Settings of ink: lines around and on posterized props.

use bevy::{ecs::VariantDefaults, prelude::*};

/// Draws lines on a posterized [`Prop`](crate::Prop), as in a comic: along its silhouette, where its depth jumps, and
/// between its materials.
///
/// On a camera, it applies to all posterized props that the camera sees and that have no `Ink` of their own. A prop as
/// trained has no lines.
///
/// Lines are smooth, and lie on the nearer side of an edge: a silhouette is drawn on the prop, and the line between two
/// props on the one in front. A line is `width` wide at the prop's distance, but at least a pixel and at most
/// `max_pixels`. Lines that would be narrower than half a pixel fade, so that distant props do not turn black. Between
/// lines that are close to each other, such as those around a small window, the lines get thinner. Ink only changes
/// colors: depth, labels and picking stay as they are. See section 4 of the method, step 13.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_plenoctree::{Ink, InkColor, PlenOctreePlugin, Posterize, Prop};
/// fn spawn(mut commands: Commands, assets: Res<AssetServer>) {
///     let ink = Ink { color: InkColor::Tone(0.3), width: 0.02, ..default() };
///     commands.spawn((Prop(assets.load("robot.plenoctree")), Posterize::toon(), ink));
/// }
/// # let mut app = App::new();
/// # app.add_plugins((MinimalPlugins, AssetPlugin::default(), PlenOctreePlugin)).add_systems(Update, spawn);
/// # app.update();
/// ```
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
#[type_path = "bevy_plenoctree"]
pub struct Ink {
    /// The color of the lines.
    ///
    /// Defaults to black.
    pub color: InkColor,
    /// The width of the lines, in world units. 0 draws none.
    ///
    /// Where a prop is not solid, lines are as wide as at the distance of the box around its leaves.
    ///
    /// Defaults to 0.012: for a prop that is about one unit large. Negative values count as 0.
    pub width: f32,
    /// The width that no line exceeds, in pixels.
    ///
    /// Defaults to 4. Clamped to 1..=[`MAX_INK_PIXELS`].
    pub max_pixels: f32,
    /// Whether the silhouette has a line.
    ///
    /// Defaults to true.
    pub silhouette: bool,
    /// Whether there are lines where the prop's depth jumps: where one part of it is in front of another that is
    /// farther away by at least eight times `width`. At that distance, the lines are faint; at twelve times, they are
    /// at full strength.
    /// There are none on glass and haze, through which something shows.
    ///
    /// Defaults to true.
    pub creases: bool,
    /// The borders between labels that have lines.
    ///
    /// Defaults to [`InkBorders::Ramps`].
    pub borders: InkBorders,
}

/// The maximum of [`Ink::max_pixels`], in pixels.
pub const MAX_INK_PIXELS: f32 = 16.0;

/// The color of [`Ink`].
#[derive(Clone, Copy, Debug, PartialEq, Reflect, VariantDefaults)]
#[reflect(Default, Clone, Debug, PartialEq)]
#[type_path = "bevy_plenoctree"]
pub enum InkColor {
    /// The same color everywhere. Its alpha is the opacity of the lines. The prop's [`PropTint`](crate::PropTint)
    /// applies to it.
    Flat(Color),
    /// The color of the label below the line, with this fraction of its linear light. Clamped to 0..=1.
    Tone(f32),
}

impl Default for InkColor {
    fn default() -> Self {
        Self::Flat(Color::BLACK)
    }
}

/// The borders between labels that [`Ink`] draws lines along. Half of the width lies on each side of the border.
#[derive(Clone, Debug, Default, PartialEq, Eq, Reflect, VariantDefaults)]
#[reflect(Default, Clone, Debug, PartialEq)]
#[type_path = "bevy_plenoctree"]
pub enum InkBorders {
    /// None.
    None,
    /// Those between two [ramps](plenoctree::palette::Palette::ramps), so between materials. A color without a ramp is
    /// a ramp by itself. This is the default.
    #[default]
    Ramps,
    /// All of them.
    Labels,
    /// Those between two ramps, if the list has the pair of their indices in either order. Indices that the palette
    /// does not have are ignored.
    Pairs(Vec<[usize; 2]>),
}

impl Default for Ink {
    fn default() -> Self {
        Self { color: default(), width: 0.012, max_pixels: 4.0, silhouette: true, creases: true, borders: default() }
    }
}
