//! Palettes by field.

use std::{collections::HashMap, path::Path};

use bevy::prelude::*;
use plenoctree::{
    PlenOctree,
    palette::{Extraction, InvalidPalette, Palette, PaletteFileError},
};

use super::{blend::BlendSpace, source::PaletteSource};

/// The palette of every field that has one. Any system may change it in any frame; the change is in the same frame's
/// picture, and nothing is allocated for it.
///
/// A posterized prop or [view](crate::PosterizeView) whose field has no palette gets one: from the file `x.palette.json`
/// beside the field's `x.npz` if there is one, by extraction if there is none. [`PaletteReady`](crate::PaletteReady) says
/// when. Palettes that are inserted here take the place of both.
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
    /// Fields whose palettes came by themselves, since that was last announced.
    #[reflect(ignore)]
    pub(super) arrived: Vec<AssetId<PlenOctree>>,
}

/// The palette of one field: the colors that were extracted, by which pixels get their labels, and as many colors that
/// are shown in their place.
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
    /// A palette that comes from elsewhere than an extraction; shown as it is.
    pub fn new(palette: Palette) -> Self {
        let shown = colors(&palette).collect();
        Self { source: palette, shown, extraction: None }
    }

    /// A palette of colors that weigh the same; shown as it is. An error if there are none, more than
    /// [`Palette::MAX_COLORS`], or some that are not finite.
    pub fn from_colors(colors: impl IntoIterator<Item = impl Into<Color>>) -> Result<Self, InvalidPalette> {
        let encoded = |color: Color| Srgba::from(color).to_f32_array_no_alpha().map(f64::from);
        Palette::new(colors.into_iter().map(|color| encoded(color.into())).collect()).map(Self::new)
    }

    /// An extraction's palette, shown as it is.
    pub(super) fn from_extraction(extraction: Extraction) -> Self {
        Self { extraction: Some(extraction.clone()), ..Self::new(extraction.palette) }
    }

    /// The source colors, encoded sRGB, and their weights: pixels get the labels that are nearest in these.
    pub fn source(&self) -> &Palette {
        &self.source
    }

    /// How the palette was extracted; `None` if it was given.
    pub fn extraction(&self) -> Option<&Extraction> {
        self.extraction.as_ref()
    }

    /// The colors that are shown, in the order of the extracted ones.
    pub fn shown(&self) -> &[Color] {
        &self.shown
    }

    /// The colors that are shown, to change.
    pub fn shown_mut(&mut self) -> &mut [Color] {
        &mut self.shown
    }

    /// Shows `color` in place of the extracted color `index`; an index that is not there changes nothing.
    pub fn set(&mut self, index: usize, color: impl Into<Color>) {
        if let Some(shown) = self.shown.get_mut(index) {
            *shown = color.into();
        }
    }

    /// Shows the blend of two palettes, color by color: `from` at `t` = 0, `to` at `t` = 1, and one of the two beyond.
    /// Colors that one of them does not have stay as they are.
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

    /// Shows the blend of the extracted colors and others: as extracted at `t` = 0, `to` at `t` = 1, and one of the two
    /// beyond. Colors that `to` does not have stay as they are.
    pub fn fade(&mut self, to: &[Color], t: f32, space: BlendSpace) {
        for ((shown, from), to) in self.shown.iter_mut().zip(colors(&self.source)).zip(to) {
            *shown = space.mix(from, *to, t);
        }
    }

    /// Shows the extracted colors again.
    pub fn reset(&mut self) {
        self.shown.clear();
        self.shown.extend(colors(&self.source));
    }

    /// Writes the extracted palette to a file, replacing what is there. Saved as `x.palette.json` beside the field
    /// `x.npz`, it is used from then on in place of extraction: what to ship with a game.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), PaletteFileError> {
        self.source.write(path)
    }
}

/// A palette's colors as Bevy's.
fn colors(palette: &Palette) -> impl Iterator<Item = Color> {
    palette.colors.iter().map(|c| Color::srgb(c[0] as f32, c[1] as f32, c[2] as f32))
}

impl Palettes {
    /// The palette of a field, if it has one yet.
    pub fn get(&self, field: impl Into<AssetId<PlenOctree>>) -> Option<&FieldPalette> {
        self.by_field.get(&field.into())
    }

    /// The palette of a field, to change.
    pub fn get_mut(&mut self, field: impl Into<AssetId<PlenOctree>>) -> Option<&mut FieldPalette> {
        self.by_field.get_mut(&field.into())
    }

    /// Gives a field a palette; one that has a palette is not extracted from.
    pub fn insert(&mut self, field: impl Into<AssetId<PlenOctree>>, palette: FieldPalette) {
        let id = field.into();
        self.files.remove(&id);
        self.by_field.insert(id, palette);
    }

    /// Gives a field the palette of a handle as soon as it is loaded, and again whenever its file changes. If it does not
    /// load, the field keeps the palette that it has, or is extracted from.
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

    /// Takes a field's palette away. If a posterized prop shows the field, it gets another one as at first: from the file
    /// beside the field, or by extraction.
    pub fn remove(&mut self, field: impl Into<AssetId<PlenOctree>>) -> Option<FieldPalette> {
        let id = field.into();
        self.files.remove(&id);
        self.by_field.remove(&id)
    }

    /// Inserts a palette that came by itself, which is announced.
    pub(super) fn arrive(&mut self, field: AssetId<PlenOctree>, palette: FieldPalette) {
        self.insert(field, palette);
        self.arrived.push(field);
    }

    /// Whether a field has no palette, and no file to expect one from.
    pub(super) fn lacks(&self, field: AssetId<PlenOctree>) -> bool {
        !self.by_field.contains_key(&field) && matches!(self.files.get(&field), Some(PaletteSource::Missing))
    }
}
