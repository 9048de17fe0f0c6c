//! Colors of a single prop.

use bevy::prelude::*;
use plenoctree::palette::Palette;

use super::blend::BlendSpace;

/// Colors that one prop shows in place of those of its field's palette: two copies of a prop in two colors.
///
/// Goes on the entity of a [`Prop`](crate::Prop), or of a camera with a [`PosterizeView`](crate::PosterizeView). Colors
/// that it does not set are those that [`Palettes`](crate::Palettes) shows, so that a team color leaves the rest to day
/// and night. Which pixels get which color is still up to the field's extracted palette.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_plenoctree::{PaletteOverride, PlenOctree, Posterize, Prop};
/// fn spawn_teams(mut commands: Commands, assets: Res<AssetServer>) {
///     for team in [Color::srgb(0.9, 0.2, 0.2), Color::srgb(0.2, 0.4, 0.9)] {
///         let colors = PaletteOverride::default().with(0, team);
///         commands.spawn((Prop(assets.load("robot.npz")), Posterize::default(), colors));
///     }
/// }
/// ```
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, PartialEq)]
#[type_path = "bevy_plenoctree"]
pub struct PaletteOverride {
    colors: Vec<Option<Color>>,
}

impl PaletteOverride {
    /// This, and `color` in place of color `index`.
    pub fn with(mut self, index: usize, color: impl Into<Color>) -> Self {
        self.set(index, color);
        self
    }

    /// What is shown in place of color `index`; `None` if that is up to the field's palette.
    pub fn get(&self, index: usize) -> Option<Color> {
        self.colors.get(index).copied().flatten()
    }

    /// Shows `color` in place of color `index`; an index that no palette has changes nothing.
    pub fn set(&mut self, index: usize, color: impl Into<Color>) {
        if index < Palette::MAX_COLORS {
            if index >= self.colors.len() {
                self.colors.resize(index + 1, None);
            }
            self.colors[index] = Some(color.into());
        }
    }

    /// Shows the blend of two palettes, as [`FieldPalette::blend`](crate::FieldPalette::blend) does it. Start from
    /// [`FieldPalette::shown`](crate::FieldPalette::shown) for a passing effect, and [`reset`](Self::reset) after it.
    pub fn blend(&mut self, from: &[Color], to: &[Color], t: f32, space: BlendSpace) {
        for (index, color) in space.mix_all(from, to, t).enumerate() {
            self.set(index, color);
        }
    }

    /// Leaves color `index` to the field's palette.
    pub fn unset(&mut self, index: usize) {
        if let Some(color) = self.colors.get_mut(index) {
            *color = None;
        }
    }

    /// Leaves every color to the field's palette.
    pub fn reset(&mut self) {
        self.colors.clear();
    }
}
