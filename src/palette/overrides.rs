//! Overriding the shown colors of a single prop.

use std::hash::{Hash, Hasher};

use bevy::prelude::*;
use plenoctree::palette::{Palette, RampAdjustment, UnmetWishes, Wish};

use super::{
    blend::BlendSpace,
    resource::{FieldPalette, decoded, encoded},
};

/// Overrides shown colors for a single entity, for example to give two props of one field different colors.
///
/// Add it to an entity with a [`Prop`](crate::Prop), or to a camera with a [`PosterizeView`](crate::PosterizeView).
/// Colors that are not overridden are the shown colors of the field's palette in [`Palettes`](crate::Palettes), so a
/// team color works together with a day and night cycle. The field's source colors still decide which pixels get which
/// label.
///
/// Colors are indexed like those of the palette: from 0, the heaviest first. Ramps have names, so that they can be
/// overridden before there is a palette.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_plenoctree::{PaletteOverride, PlenOctreePlugin, Posterize, Prop};
/// fn spawn_teams(mut commands: Commands, assets: Res<AssetServer>) {
///     for team in [Color::srgb(0.9, 0.2, 0.2), Color::srgb(0.2, 0.4, 0.9)] {
///         let colors = PaletteOverride::default().with_ramp("body", team);
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
    /// Ramps by name. Colors of their own go first.
    ramps: Vec<(String, RampAdjustment)>,
}

/// Hashes a color as it is shown.
pub(crate) fn hash_color(color: Color, state: &mut impl Hasher) {
    Srgba::from(color).to_vec3().to_array().map(f32::to_bits).hash(state);
}

impl PaletteOverride {
    /// Overrides color `index` and returns `self`, like [`set`](Self::set).
    pub fn with(mut self, index: usize, color: impl Into<Color>) -> Self {
        self.set(index, color);
        self
    }

    /// Shows the ramp of this name in another color and returns `self`, like [`set_ramp`](Self::set_ramp).
    pub fn with_ramp(mut self, name: &str, color: impl Into<Color>) -> Self {
        self.set_ramp(name, color);
        self
    }

    /// Calls `show` with the index and the new color of each color of a palette that is overridden. A color may come
    /// twice: the later one counts.
    pub(crate) fn apply(&self, palette: &Palette, mut show: impl FnMut(usize, Color)) {
        for (name, adjustment) in &self.ramps {
            let shown = palette
                .ramp(name)
                .map(|ramp| palette.show_ramp(ramp, adjustment, |tone, color| show(tone, decoded(&color))));
            if shown.is_none_or(|shown| shown.is_err()) {
                let names: Vec<_> = palette.ramps.iter().map(|ramp| ramp.name.as_str()).collect();
                warn_once!("found no ramp {name:?} in a palette, expected one of {names:?}");
            }
        }
        let own = self.colors.iter().enumerate().take(palette.colors.len());
        own.for_each(|(index, color)| color.iter().for_each(|color| show(index, *color)));
    }

    /// Hashes everything that decides what [`apply`](Self::apply) shows of a palette.
    pub(crate) fn hash_colors(&self, state: &mut impl Hasher) {
        for (index, color) in self.colors.iter().enumerate() {
            if let Some(color) = color {
                index.hash(state);
                hash_color(*color, state);
            }
        }
        for (name, RampAdjustment { color, brightness, contrast, saturation }) in &self.ramps {
            name.hash(state);
            color.map(|color| color.map(f64::to_bits)).hash(state);
            [brightness, contrast, saturation].map(|value| value.to_bits()).hash(state);
        }
    }

    /// Returns the colors that an entity with these overrides shows, in the order of the field's source colors.
    ///
    /// ```
    /// # use bevy::prelude::*;
    /// # use bevy_plenoctree::{FieldPalette, PaletteOverride};
    /// let palette = FieldPalette::from_colors([Srgba::WHITE, Srgba::BLACK]).unwrap();
    /// let own = PaletteOverride::default().with(1, Srgba::RED);
    /// assert_eq!(own.shown(&palette), [Srgba::WHITE.into(), Srgba::RED.into()]);
    /// ```
    pub fn shown(&self, palette: &FieldPalette) -> Vec<Color> {
        let mut shown = palette.shown().to_vec();
        self.apply(palette.palette(), |index, color| shown[index] = color);
        shown
    }

    /// Returns the color that overrides color `index`, or `None` if it is not overridden by itself.
    pub fn get(&self, index: usize) -> Option<Color> {
        self.colors.get(index).copied().flatten()
    }

    /// Returns how the ramp of this name is shown, or `None` if it is not overridden by its name.
    pub fn ramp(&self, name: &str) -> Option<&RampAdjustment> {
        self.ramps.iter().find(|(known, _)| known == name).map(|(_, adjustment)| adjustment)
    }

    /// Returns whether it overrides nothing.
    pub fn is_empty(&self) -> bool {
        self.colors.is_empty() && self.ramps.is_empty()
    }

    /// Overrides color `index`. It has no effect while the palette of the field has no such color. Alpha is ignored.
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

    /// Shows the ramp of this name in another color: a team color in one line. Its mean becomes the color, and its
    /// contrast is kept as far as [`FieldPalette::set_ramp`](crate::FieldPalette::set_ramp) says. Replaces an earlier
    /// adjustment of the same ramp.
    ///
    /// It has no effect while the field has no palette. If the palette has no such ramp, a warning is logged (once per
    /// app). Colors that are overridden by themselves keep their color.
    ///
    /// ```
    /// # use bevy::prelude::*;
    /// # use bevy_plenoctree::PaletteOverride;
    /// # let team = Color::srgb(0.1, 0.2, 0.9);
    /// let mut colors = PaletteOverride::default();
    /// colors.set_ramp("red", team);
    /// ```
    pub fn set_ramp(&mut self, name: &str, color: impl Into<Color>) {
        self.adjust_ramp(name, &RampAdjustment::to_color(encoded(color)));
    }

    /// Shows the ramp of this name with an adjustment of its source colors, like [`set_ramp`](Self::set_ramp). Does not
    /// allocate if the ramp was adjusted before.
    pub fn adjust_ramp(&mut self, name: &str, adjustment: &RampAdjustment) {
        match self.ramps.iter_mut().find(|(known, _)| known == name) {
            Some((_, shown)) => *shown = *adjustment,
            None => self.ramps.push((name.into(), *adjustment)),
        }
    }

    /// Moves ramps of the field's palette on this entity so that the wished labels get the wished colors, like
    /// [`FieldPalette::recolor`].
    ///
    /// Overrides all colors of every ramp that has a wish and is not in `locked`, and every color in no ramp that has a
    /// wish. It does so even if they already show the wished colors: wishes belong to the entity, and outlast changes
    /// of the field's palette. Later adjustments of these ramps have no effect until their colors are
    /// [`unset`](Self::unset).
    ///
    /// Returns an error that says which wishes cannot be met. The colors then come as near to all of them as possible.
    pub fn recolor(&mut self, palette: &FieldPalette, wishes: &[Wish], locked: &[usize]) -> Result<(), UnmetWishes> {
        let mut recolored = palette.clone();
        recolored.show(self.shown(palette));
        let result = recolored.recolor(wishes, locked);
        let has = |wish: &Wish| wish.label.first.max(wish.label.second) < palette.shown().len();
        let is_of = |wish: &Wish, tone: usize| has(wish) && [wish.label.first, wish.label.second].contains(&tone);
        let is_wished = |tone: usize| wishes.iter().any(|wish| is_of(wish, tone));
        let unmet = result.as_ref().err();
        let is_met = |at: usize| unmet.is_none_or(|error| error.unmet.iter().all(|unmet| unmet.wish != at));
        let is_own = |tone: usize| match palette.palette().ramp_of(tone) {
            Some(ramp) => !locked.contains(&ramp) && palette.ramps()[ramp].tones.iter().any(|tone| is_wished(*tone)),
            // Colors in no ramp never move, but may show what was wished.
            None => wishes.iter().enumerate().any(|(at, wish)| is_of(wish, tone) && is_met(at)),
        };
        for (index, color) in recolored.shown().iter().enumerate().filter(|(index, _)| is_own(*index)) {
            self.set(index, *color);
        }
        result
    }

    /// Lets the override of a ramp follow its new name. Returns whether there is one.
    #[cfg(feature = "egui")]
    pub(crate) fn rename_ramp(&mut self, old: &str, new: &str) -> bool {
        let is_known = self.ramps.iter().any(|(name, _)| name == old);
        if is_known && old != new {
            self.unset_ramp(new);
            self.ramps.iter_mut().filter(|(name, _)| name == old).for_each(|(name, _)| *name = new.into());
        }
        is_known
    }

    /// Removes the override of color `index`. Those of ramps stay.
    pub fn unset(&mut self, index: usize) {
        if let Some(color) = self.colors.get_mut(index) {
            *color = None;
        }
        while self.colors.pop_if(|color| color.is_none()).is_some() {}
    }

    /// Removes the override of the ramp of this name. Those of its colors stay.
    pub fn unset_ramp(&mut self, name: &str) {
        self.ramps.retain(|(known, _)| known != name);
    }

    /// Removes all overrides.
    pub fn reset(&mut self) {
        self.colors.clear();
        self.ramps.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ramp that one entity overrides looks as if its field showed it, and colors by index go first.
    #[test]
    fn overridden_ramps_show_the_colors_of_the_field_s() {
        let mut source = Palette::new(vec![[0.5, 0.1, 0.1], [0.8, 0.2, 0.2], [0.2, 0.3, 0.7]]).unwrap();
        source.gather_tones(&[0, 1], "cap").unwrap();
        let mut palette = FieldPalette::new(source);
        let green = Color::srgb(0.2, 0.7, 0.3);
        let own = PaletteOverride::default().with_ramp("cap", green).with_ramp("stem", Color::BLACK);
        let shown = own.shown(&palette);
        assert_eq!(own.with(1, Color::WHITE).shown(&palette), [shown[0], Color::WHITE, shown[2]]);
        let source: Vec<_> = palette.source().collect();
        assert_eq!(shown[2], source[2]);
        palette.set_ramp(0, green);
        assert_eq!(shown, palette.shown());
        assert!(shown[0] != source[0]);
    }

    /// What is set and unset again is gone.
    #[test]
    fn overrides_are_removed() {
        let mut own =
            PaletteOverride::default().with(3, Color::WHITE).with(5, Color::BLACK).with_ramp("cap", Color::WHITE);
        assert!(own.ramp("cap").is_some() && own.ramp("stem").is_none());
        own.unset(3);
        assert_eq!((own.get(3), own.get(5)), (None, Some(Color::BLACK)));
        own.unset(5);
        assert!(!own.is_empty());
        own.unset_ramp("cap");
        assert!(own.is_empty() && own == PaletteOverride::default());
    }

    /// Wishes are met on top of what an entity overrides already.
    #[test]
    fn wishes_replace_overrides() {
        let mut source = Palette::new(vec![[0.5, 0.1, 0.1], [0.8, 0.2, 0.2], [0.2, 0.3, 0.7]]).unwrap();
        source.gather_tones(&[0, 1], "cap").unwrap();
        let palette = FieldPalette::new(source);
        let mut own = PaletteOverride::default().with(1, Color::srgb(0.2, 0.2, 0.9));
        let before = palette.shown()[1];
        own.recolor(&palette, &[Wish::tone(1, encoded(before))], &[]).unwrap();
        assert_eq!(own.shown(&palette)[1], before);
    }

    /// A wish stays met when the field's palette changes, even if it was for what was shown already. The rest of its
    /// ramp stays with it, and other colors follow the field.
    #[test]
    fn wishes_outlast_changes_of_the_field() {
        let colors = vec![[0.5, 0.1, 0.1], [0.8, 0.2, 0.2], [0.2, 0.3, 0.7], [0.4; 3], [0.6; 3]];
        let mut source = Palette::new(colors).unwrap();
        source.gather_tones(&[0, 1], "cap").unwrap();
        source.gather_tones(&[2], "stem").unwrap();
        let mut palette = FieldPalette::new(source);
        let (mut own, mut locked) = (PaletteOverride::default(), PaletteOverride::default());
        let before = palette.shown().to_vec();
        let wishes = [1, 3].map(|tone| Wish::tone(tone, encoded(before[tone])));
        own.recolor(&palette, &wishes, &[]).unwrap();
        locked.recolor(&palette, &wishes[..1], &[0]).unwrap();
        let unknown = locked.recolor(&palette, &[Wish::tone(9, [0.0; 3])], &[]);
        assert!(unknown.is_err() && locked == PaletteOverride::default());
        palette.shown_mut().fill(Color::BLACK);
        let shown = own.shown(&palette);
        assert_eq!([shown[1], shown[2], shown[3], shown[4]], [before[1], Color::BLACK, before[3], Color::BLACK]);
        // But for rounding, as the ramp moves to where it was.
        assert!(Srgba::from(shown[0]).to_vec3().distance(Srgba::from(before[0]).to_vec3()) < 1e-5, "{:?}", shown[0]);
    }
}
