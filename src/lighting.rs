//! Settings of the light that falls on props.

use bevy::prelude::*;

/// The maximum of [`PropLighting::bands`].
pub const MAX_BANDS: u32 = 8;
/// The maximum of [`PropLighting::brightness`].
pub const MAX_BRIGHTNESS: f32 = 16.0;

/// Lets the shadows and the lights of the scene fall on a [`Prop`](crate::Prop). Requires the feature `shadows`,
/// and Bevy's `PbrPlugin`.
///
/// Props without it keep the light that they were trained with, wherever they are. Props with it keep that light too,
/// as their own shading, and get darker where something else blocks the scene's lights. Lights are weighted by how much
/// of their light would arrive; ambient light does not count for shadows, and lights without shadow maps are never
/// blocked. With a [`brightness`](Self::brightness), props also get brighter where light falls on them.
///
/// Nothing inside the box around a prop's leaves casts a shadow on it, neither its own parts nor a mesh that it holds:
/// the shadows of its own parts are already in its colors. [`self_shadow_distance`](Self::self_shadow_distance) changes
/// that.
///
/// A posterized prop goes down its ramps: where light is missing, a darker tone of the same ramp replaces the pixel's
/// label, in the palette's shown colors. Where light is added, it goes up in the same way. Source colors choose both,
/// so recoloring moves no edge. Where the palette has no such label, the shown color is darkened or lightened instead.
/// A prop as trained that a [`PosterizeView`](crate::PosterizeView) posterizes goes down the palette of the view.
/// See section 4 of the method, step 12.
///
/// It takes effect where props are solid, for cameras that draw them at
/// [`PropPlacement::Scene`](crate::PropPlacement::Scene).
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_plenoctree::{PlenOctreePlugin, Posterize, Prop, PropLighting};
/// fn spawn(mut commands: Commands, assets: Res<AssetServer>) {
///     // Shadows take half of the light, in one step with a clean edge. A red lamp makes the prop a little red.
///     let lighting = PropLighting { shadows: 0.5, tint: 0.3, ..default() };
///     commands.spawn((Prop(assets.load("toadstool.plenoctree")), Posterize::default(), lighting));
/// }
/// # App::new().add_plugins((MinimalPlugins, AssetPlugin::default(), PlenOctreePlugin)).add_systems(Update, spawn).update();
/// ```
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
#[type_path = "bevy_plenoctree"]
pub struct PropLighting {
    /// The fraction of linear light that is lost where no light arrives. 0 disables shadows.
    ///
    /// Defaults to 0.6. Clamped to 0..=1.
    pub shadows: f32,
    /// How much of the lights' color the prop takes on, from 0 (none) to 1 (all of it). White lights change nothing.
    /// Multiplies linear light by the color of the light that arrives, whose largest channel is 1.
    ///
    /// Defaults to 0. Clamped to 0..=1.
    pub tint: f32,
    /// The number of steps to full shadow, and to the full [`brightness`](Self::brightness), where the prop is
    /// posterized. On a prop as trained, shadows have soft edges if the scene's shadows do, or with a
    /// [`brightness`](Self::brightness).
    ///
    /// Defaults to 1: a pixel is in shadow where half of the light is missing. Clamped to 1..=[`MAX_BANDS`].
    pub bands: u32,
    /// The minimum distance toward a light, in world units, at which the prop's own parts, and objects inside the box
    /// around its leaves, cast shadows on it. Nothing outside the box is ever skipped.
    ///
    /// The colors of a field already contain the shadows that its parts cast when it was trained, so this adds to them.
    /// Use it if the scene's lights come from elsewhere: the side that faces away from a light gets dark, and a cap
    /// shades the stem below. 15% of the prop's size is a good start: at smaller distances, knobs and frames cast
    /// shadows whose nearest part is missing, which look like spots. Very small distances cause shadow acne on surfaces
    /// that the light grazes, because surfaces consist of cells and shadow maps of texels.
    ///
    /// Defaults to [`f32::MAX`]: the prop casts no shadow on itself. Clamped to 0..=[`f32::MAX`], because JSON has no
    /// infinity.
    pub self_shadow_distance: f32,
    /// The light that a prop gains in the brightest light, as a multiple of its own linear light. Where the scene's
    /// lights make a white mesh `light` times as bright as white, the prop gains `1 - exp(-light)` of this: 0.63 of it
    /// where a white mesh looks just white, and 0.4 of it in half of that light.
    ///
    /// Counts directional, point and spot lights with their shadows and their range, by the angle at which their light
    /// falls on the prop, and ambient light. It does not count environment maps. Point and spot lights only add: where
    /// they are blocked, the prop looks as it would without them. Where directional light is blocked, its share of all
    /// the light that would arrive is subtracted from the added light, so the shadow of the moon is lost in the light
    /// of a lamp. The surface is smoothed over at least 3% of the prop's size, so that steps end at smooth lines
    /// although the prop consists of cells. Smaller parts are lit like their surroundings.
    ///
    /// The light of a lamp comes on top of what the prop was trained with. To make it dark where no lamp shines, dim it
    /// with a [`PropTint`](crate::PropTint).
    ///
    /// Defaults to 0, which costs nothing. Clamped to 0..=[`MAX_BRIGHTNESS`].
    pub brightness: f32,
    /// How strongly lights from beside and from behind light the prop along its silhouette, relative to a surface that
    /// faces them. Takes effect with a [`brightness`](Self::brightness).
    ///
    /// Defaults to 0. Clamped to 0..=1.
    pub rim: f32,
}

impl Default for PropLighting {
    fn default() -> Self {
        Self { shadows: 0.6, tint: 0.0, bands: 1, self_shadow_distance: f32::MAX, brightness: 0.0, rim: 0.0 }
    }
}

impl PropLighting {
    /// Returns the lighting of a cartoon, for a prop that is `size` world units large: two steps of shadow and two of
    /// light with clean lines between them, a thin rim, and a little of the lights' color. Parts cast shadows on others
    /// that are at least 15% of `size` away.
    pub const fn toon(size: f32) -> Self {
        Self { shadows: 0.5, tint: 0.25, bands: 2, self_shadow_distance: 0.15 * size, brightness: 0.6, rim: 0.5 }
    }

    /// Clamps every setting to its valid range. NaN becomes 0, and a distance that is NaN the largest one.
    pub(crate) fn clamped(self) -> Self {
        let share = |value: f32| if value.is_nan() { 0.0 } else { value.clamp(0.0, 1.0) };
        let distance = self.self_shadow_distance;
        Self {
            shadows: share(self.shadows),
            tint: share(self.tint),
            bands: self.bands.clamp(1, MAX_BANDS),
            self_shadow_distance: if distance.is_nan() { f32::MAX } else { distance.clamp(0.0, f32::MAX) },
            brightness: if self.brightness.is_nan() { 0.0 } else { self.brightness.clamp(0.0, MAX_BRIGHTNESS) },
            rim: share(self.rim),
        }
    }
}
