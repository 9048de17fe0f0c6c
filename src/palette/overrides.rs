//! Overriding the shown colors of a single prop.

use bevy::prelude::*;
use plenoctree::palette::Palette;

use super::blend::BlendSpace;

/// Overrides shown colors for a single entity, for example to give two props of one field different colors.
///
/// Add it to an entity with a [`Prop`](crate::Prop), or to a camera with a [`PosterizeView`](crate::PosterizeView).
/// Colors that are not overridden are the shown colors of the field's palette in [`Palettes`](crate::Palettes), so a
/// team color works together with a day and night cycle. The field's source colors still decide which pixels get which
/// label.
///
/// Colors are indexed like those of the palette: from 0, the heaviest first.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_plenoctree::{PaletteOverride, PlenOctreePlugin, Posterize, Prop};
/// fn spawn_teams(mut commands: Commands, assets: Res<AssetServer>) {
///     for team in [Color::srgb(0.9, 0.2, 0.2), Color::srgb(0.2, 0.4, 0.9)] {
///         let colors = PaletteOverride::default().with(0, team);
///         commands.spawn((Prop(assets.load("robot.plenoctree")), Posterize::default(), colors));
///     }
/// }
/// # let mut app = App::new();
/// # app.add_plugins((MinimalPlugins, AssetPlugin::default(), PlenOctreePlugin)).add_systems(Update, spawn_teams);
/// # app.update();
/// ```
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, PartialEq)]
#[type_path = "bevy_plenoctree"]
pub struct PaletteOverride {
    colors: Vec<Option<Color>>,
}

impl PaletteOverride {
    /// Overrides color `index` and returns `self`, like [`set`](Self::set).
    pub fn with(mut self, index: usize, color: impl Into<Color>) -> Self {
        self.set(index, color);
        self
    }

    /// Returns the color that overrides color `index`, or `None` if it is not overridden.
    pub fn get(&self, index: usize) -> Option<Color> {
        self.colors.get(index).copied().flatten()
    }

    /// Overrides color `index`. It has no effect while the palette of the field has no such color.
    ///
    /// If no palette can have such a color ([`Palette::MAX_COLORS`]), changes nothing, logs a warning (once per app),
    /// and returns false.
    pub fn set(&mut self, index: usize, color: impl Into<Color>) -> bool {
        if index >= Palette::MAX_COLORS {
            warn_once!("cannot override color {index}: palettes have at most {} colors", Palette::MAX_COLORS);
            return false;
        }
        if index >= self.colors.len() {
            self.colors.resize(index + 1, None);
        }
        self.colors[index] = Some(color.into());
        true
    }

    /// Overrides colors with the blend of two palettes, color by color: `from` at `t` = 0 and `to` at `t` = 1. `t` is
    /// clamped to 0..=1. Colors that `from` or `to` lacks are not changed.
    ///
    /// For a temporary effect, blend from [`FieldPalette::shown`](crate::FieldPalette::shown), and call
    /// [`reset`](Self::reset) when it ends.
    pub fn blend(&mut self, from: &[Color], to: &[Color], t: f32, space: BlendSpace) {
        for (index, color) in space.mix_all(from, to, t).enumerate() {
            self.set(index, color);
        }
    }

    /// Removes the override of color `index`.
    pub fn unset(&mut self, index: usize) {
        if let Some(color) = self.colors.get_mut(index) {
            *color = None;
        }
    }

    /// Removes all overrides.
    pub fn reset(&mut self) {
        self.colors.clear();
    }
}
