//! The palettes of all fields.

use std::{collections::HashMap, path::Path};

use bevy::prelude::*;
use plenoctree::{
    PlenOctree,
    palette::{Extraction, InvalidPalette, Palette, PaletteFileError},
};

use super::{blend::BlendSpace, source::PaletteSource};

/// Stores the palettes of all fields.
///
/// Any system may change a palette in any frame. Changes show in the same frame and do not allocate.
///
/// If the field of a posterized prop or [view](crate::PosterizeView) has no palette, the plugin loads one from the file
/// `x.palette.json` next to the field's `x.npz` or, if there is no such file, extracts one.
/// [`PaletteReady`](crate::PaletteReady) is written when it is ready. A palette that you insert replaces both.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_plenoctree::{BlendSpace, Palettes, PlenOctree};
/// fn paint_it_blue(field: Handle<PlenOctree>, mut palettes: ResMut<Palettes>) {
///     if let Some(palette) = palettes.get_mut(&field) {
///         palette.set(0, Color::srgb(0.1, 0.2, 0.9));
///     }
/// }
/// ```
#[derive(Resource, Default, Reflect)]
#[reflect(Resource, Default)]
#[type_path = "bevy_plenoctree"]
pub struct Palettes {
    pub(super) by_field: HashMap<AssetId<PlenOctree>, FieldPalette>,
    #[reflect(ignore)]
    pub(super) files: HashMap<AssetId<PlenOctree>, PaletteSource>,
    /// Fields whose palettes were loaded or extracted since [`PaletteReady`](crate::PaletteReady) was last written.
    #[reflect(ignore)]
    pub(super) arrived: Vec<AssetId<PlenOctree>>,
}

/// The palette of one field.
///
/// It has two sets of colors of the same size. The *source* colors decide which pixels get which label, and never
/// change. The *shown* colors appear on screen in their place, and are yours to change. Colors are indexed from 0, the
/// heaviest first.
#[derive(Clone, Debug, Reflect)]
#[reflect(Clone, Debug)]
#[type_path = "bevy_plenoctree"]
pub struct FieldPalette {
    source: Palette,
    shown: Vec<Color>,
    #[reflect(ignore)]
    extraction: Option<Extraction>,
}

impl FieldPalette {
    /// Creates a palette that was not extracted from the field. The shown colors are the palette's own.
    pub fn new(palette: Palette) -> Self {
        let shown = colors(&palette).collect();
        Self { source: palette, shown, extraction: None }
    }

    /// Creates a palette from colors of equal weight. They are both the source colors and the shown colors.
    ///
    /// Returns an error if there are no colors, more than [`Palette::MAX_COLORS`], or any that are not finite.
    pub fn from_colors(colors: impl IntoIterator<Item = impl Into<Color>>) -> Result<Self, InvalidPalette> {
        let encoded = |color: Color| Srgba::from(color).to_f32_array_no_alpha().map(f64::from);
        Palette::new(colors.into_iter().map(|color| encoded(color.into())).collect()).map(Self::new)
    }

    /// Creates the palette of an extraction. The shown colors are the source colors.
    pub(super) fn from_extraction(extraction: Extraction) -> Self {
        Self { extraction: Some(extraction.clone()), ..Self::new(extraction.palette) }
    }

    /// Returns the source colors, in encoded sRGB, and their weights. Each pixel gets the label whose blend of source
    /// colors is nearest.
    pub fn source(&self) -> &Palette {
        &self.source
    }

    /// Returns how the palette was extracted, or `None` if it was loaded or inserted.
    pub fn extraction(&self) -> Option<&Extraction> {
        self.extraction.as_ref()
    }

    /// Returns the shown colors, in the order of the source colors.
    pub fn shown(&self) -> &[Color] {
        &self.shown
    }

    /// Returns the shown colors mutably, in the order of the source colors.
    pub fn shown_mut(&mut self) -> &mut [Color] {
        &mut self.shown
    }

    /// Sets the shown color `index`. Does nothing if the palette has no such color.
    pub fn set(&mut self, index: usize, color: impl Into<Color>) {
        if let Some(shown) = self.shown.get_mut(index) {
            *shown = color.into();
        }
    }

    /// Sets the shown colors to the blend of two palettes, color by color: `from` at `t` = 0 and `to` at `t` = 1. `t`
    /// is clamped to 0..=1. Colors that `from` or `to` lacks are not changed.
    ///
    /// ```
    /// # use bevy::prelude::*;
    /// # use bevy_plenoctree::{BlendSpace, FieldPalette};
    /// fn fall_asleep(palette: &mut FieldPalette, day: &[Color], night: &[Color], time: &Time) {
    ///     palette.blend(day, night, time.elapsed_secs() / 10.0, BlendSpace::Oklab);
    /// }
    /// ```
    pub fn blend(&mut self, from: &[Color], to: &[Color], t: f32, space: BlendSpace) {
        self.shown.iter_mut().zip(space.mix_all(from, to, t)).for_each(|(shown, color)| *shown = color);
    }

    /// Sets the shown colors to the blend of the source colors and other colors: the source colors at `t` = 0 and `to`
    /// at `t` = 1. `t` is clamped to 0..=1. Colors that `to` lacks are not changed.
    pub fn fade(&mut self, to: &[Color], t: f32, space: BlendSpace) {
        for ((shown, from), to) in self.shown.iter_mut().zip(colors(&self.source)).zip(to) {
            *shown = space.mix(from, *to, t);
        }
    }

    /// Resets the shown colors to the source colors.
    pub fn reset(&mut self) {
        self.shown.clear();
        self.shown.extend(colors(&self.source));
    }

    /// Writes the source colors and their weights to a JSON file, replacing any existing file. `path` is a file system
    /// path, not an asset path.
    ///
    /// To skip extraction at run time, save the palette next to the field: as `x.palette.json` next to `x.npz`.
    ///
    /// Returns an error if the file cannot be written, or if the palette is [invalid](Palette::validate).
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), PaletteFileError> {
        self.source.write(path)
    }
}

/// Returns a palette's colors as Bevy colors.
fn colors(palette: &Palette) -> impl Iterator<Item = Color> {
    palette.colors.iter().map(|c| Color::srgb(c[0] as f32, c[1] as f32, c[2] as f32))
}

impl Palettes {
    /// Returns the palette of a field, if it has one yet.
    pub fn get(&self, field: impl Into<AssetId<PlenOctree>>) -> Option<&FieldPalette> {
        self.by_field.get(&field.into())
    }

    /// Returns the palette of a field mutably, if it has one yet.
    pub fn get_mut(&mut self, field: impl Into<AssetId<PlenOctree>>) -> Option<&mut FieldPalette> {
        self.by_field.get_mut(&field.into())
    }

    /// Sets the palette of a field, instead of loading or extracting one.
    pub fn insert(&mut self, field: impl Into<AssetId<PlenOctree>>, palette: FieldPalette) {
        let id = field.into();
        self.files.remove(&id);
        self.by_field.insert(id, palette);
    }

    /// Sets the palette of a field from an asset as soon as it is loaded, and again whenever it changes.
    /// [`PaletteReady`](crate::PaletteReady) is written whenever that changes the palette. If the asset fails to load,
    /// the field keeps the palette that it has; if it has none, one is extracted.
    ///
    /// ```
    /// # use bevy::prelude::*;
    /// # use bevy_plenoctree::{Palettes, PlenOctree};
    /// fn winter(field: Handle<PlenOctree>, assets: Res<AssetServer>, mut palettes: ResMut<Palettes>) {
    ///     palettes.insert_handle(&field, assets.load("winter.palette.json"));
    /// }
    /// ```
    pub fn insert_handle(&mut self, field: impl Into<AssetId<PlenOctree>>, palette: Handle<Palette>) {
        self.files.insert(field.into(), PaletteSource::Expected(palette));
    }

    /// Removes and returns the palette of a field. If a posterized prop or view uses the field, a palette is loaded
    /// from the file next to the field or extracted, as at first.
    pub fn remove(&mut self, field: impl Into<AssetId<PlenOctree>>) -> Option<FieldPalette> {
        let id = field.into();
        self.files.remove(&id);
        self.by_field.remove(&id)
    }

    /// Inserts a palette that was extracted, for which [`PaletteReady`](crate::PaletteReady) is written.
    pub(super) fn arrive(&mut self, field: AssetId<PlenOctree>, palette: FieldPalette) {
        self.insert(field, palette);
        self.arrived.push(field);
    }

    /// Returns whether a field has no palette and none is being loaded.
    pub(super) fn lacks(&self, field: AssetId<PlenOctree>) -> bool {
        !self.by_field.contains_key(&field) && matches!(self.files.get(&field), Some(PaletteSource::Missing))
    }
}
