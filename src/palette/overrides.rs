//! Overriding the shown colors of a single prop.

use bevy::prelude::*;
use plenoctree::palette::{Palette, RampAdjustment, UnmetWishes, Wish};

use super::{
    blend::BlendSpace,
    resource::{FieldPalette, decoded, encoded, is_ramp},
};

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

    /// Shows a ramp of the field's palette in another color on this entity: a team color in one line.
    ///
    /// ```
    /// # use bevy::prelude::*;
    /// # use bevy_plenoctree::{FieldPalette, Palette, PaletteOverride};
    /// # let mut source = Palette::new(vec![[0.5, 0.1, 0.1], [0.8, 0.2, 0.2]]).unwrap();
    /// # source.ramps = source.guess_ramps();
    /// # let (palette, team) = (FieldPalette::new(source), Color::srgb(0.1, 0.2, 0.9));
    /// let mut colors = PaletteOverride::default();
    /// colors.set_ramp(&palette, 0, team);
    /// # assert!((0..2).all(|index| colors.get(index).unwrap().to_srgba().blue > 0.2));
    /// ```
    ///
    /// Its mean becomes the color, and light and dark stay as far apart. If there is no such ramp, changes nothing, logs a
    /// warning (once per app), and returns false.
    pub fn set_ramp(&mut self, palette: &FieldPalette, ramp: usize, color: impl Into<Color>) -> bool {
        self.adjust_ramp(palette, ramp, &RampAdjustment::to_color(encoded(color)))
    }

    /// Shows a ramp of the field's palette on this entity with an adjustment of its source colors. Once all its colors are
    /// overridden, it does not allocate.
    ///
    /// If there is no such ramp, changes nothing, logs a warning (once per app), and returns false.
    pub fn adjust_ramp(&mut self, palette: &FieldPalette, ramp: usize, adjustment: &RampAdjustment) -> bool {
        let palette = palette.palette();
        let set = |tone: usize, color: [f64; 3]| {
            self.set(tone, decoded(&color));
        };
        palette.show_ramp(ramp, adjustment, set).is_ok() || is_ramp(palette, ramp)
    }

    /// Moves ramps of the field's palette on this entity so that labels get given colors, like
    /// [`FieldPalette::recolor`]. Overrides the colors of ramps that have a wish and are not in `locked`.
    ///
    /// Returns an error that says which wishes cannot be met. The colors then come as near to all of them as possible.
    pub fn recolor(&mut self, palette: &FieldPalette, wishes: &[Wish], locked: &[usize]) -> Result<(), UnmetWishes> {
        let palette = palette.palette();
        let (colors, result) = match palette.recolored(wishes, locked) {
            Ok(colors) => (colors, Ok(())),
            Err(unmet) => (unmet.nearest.clone(), Err(unmet)),
        };
        for (index, color) in colors.iter().enumerate().filter(|(index, color)| **color != palette.colors[*index]) {
            self.set(index, decoded(color));
        }
        result
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
