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
/// Any system may change a palette in any frame. Changes are visible in the same frame and do not allocate.
///
/// If the field of a posterized prop or [view](crate::PosterizeView) has no palette, the plugin loads one from the file
/// `x.palette.json` next to the field's `x.plenoctree` or `x.npz` or, if there is no such file, extracts one.
/// [`PaletteReady`](crate::PaletteReady) is written when it is ready. A palette that you insert takes precedence over
/// both.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_plenoctree::{FieldPalette, Palettes, PlenOctree, PlenOctreePlugin, Prop};
/// fn paint_it_blue(props: Query<&Prop>, mut palettes: ResMut<Palettes>) {
///     for prop in &props {
///         if let Some(palette) = palettes.get_mut(&prop.0) {
///             palette.set(0, Color::srgb(0.1, 0.2, 0.9));
///         }
///     }
/// }
/// # let mut app = App::new();
/// # app.add_plugins((MinimalPlugins, AssetPlugin::default(), PlenOctreePlugin)).add_systems(Update, paint_it_blue);
/// # let field = Handle::<PlenOctree>::default();
/// # app.world_mut().resource_mut::<Palettes>().insert(&field, FieldPalette::from_colors([Color::WHITE]).unwrap());
/// # app.world_mut().spawn(Prop(field.clone()));
/// # app.update();
/// # let palette = app.world().resource::<Palettes>().get(&field).unwrap();
/// # assert_eq!(palette.shown(), [Color::srgb(0.1, 0.2, 0.9)]);
/// ```
#[derive(Resource, Default, Reflect)]
#[reflect(Resource, Default)]
#[type_path = "bevy_plenoctree"]
pub struct Palettes {
    pub(super) by_field: HashMap<AssetId<PlenOctree>, FieldPalette>,
    #[reflect(ignore)]
    pub(super) files: HashMap<AssetId<PlenOctree>, PaletteSource>,
    /// Fields whose palettes were inserted or removed, so that earlier failures no longer matter.
    #[reflect(ignore)]
    pub(super) assigned: Vec<AssetId<PlenOctree>>,
    /// Fields whose palettes were loaded or extracted since [`PaletteReady`](crate::PaletteReady) was last written.
    #[reflect(ignore)]
    pub(super) arrived: Vec<AssetId<PlenOctree>>,
}

/// The palette of one field.
///
/// It has two sets of colors of the same size. The *source* colors decide which pixels get which label, and never
/// change. The *shown* colors appear on screen in their place, and are yours to change. Colors are indexed from 0, the
/// heaviest first.
///
/// The color on screen is the last of these that exists:
///
/// 1. the source colors,
/// 2. the shown colors, which all props of the field share,
/// 3. the colors of the entity's [`PaletteOverride`](crate::PaletteOverride),
///
/// multiplied by its [`PropTint`](crate::PropTint).
#[derive(Clone, Debug, Reflect)]
#[reflect(Clone, Debug)]
#[type_path = "bevy_plenoctree"]
pub struct FieldPalette {
    palette: Palette,
    source: Vec<Color>,
    shown: Vec<Color>,
    #[reflect(ignore)]
    extraction: Option<Extraction>,
}

impl FieldPalette {
    /// Creates a palette that was not extracted from the field. The shown colors are the palette's own.
    pub fn new(palette: Palette) -> Self {
        let encoded = |c: &[f64; 3]| Color::srgb(c[0] as f32, c[1] as f32, c[2] as f32);
        let source: Vec<_> = palette.colors.iter().map(encoded).collect();
        Self { palette, shown: source.clone(), source, extraction: None }
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

    /// Returns the source colors. Each pixel gets the label whose blend of source colors is nearest.
    pub fn source(&self) -> &[Color] {
        &self.source
    }

    /// Returns the palette of the source colors: their exact values and their weights, as in a file.
    pub fn palette(&self) -> &Palette {
        &self.palette
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

    /// Sets the shown color `index`. If the palette has no such color, changes nothing, logs a warning (once per app),
    /// and returns false.
    pub fn set(&mut self, index: usize, color: impl Into<Color>) -> bool {
        match self.shown.get_mut(index) {
            Some(shown) => {
                *shown = color.into();
                true
            }
            None => {
                warn_once!("cannot set color {index} of a palette with {} colors", self.shown.len());
                false
            }
        }
    }

    /// Sets the shown colors to the blend of two palettes, color by color: `from` at `t` = 0 and `to` at `t` = 1. `t`
    /// is clamped to 0..=1. Colors that `from` or `to` lacks are not changed.
    ///
    /// ```
    /// # use bevy::prelude::*;
    /// # use bevy_plenoctree::{BlendSpace, FieldPalette};
    /// let [day, night] = [[Color::WHITE], [Color::BLACK]];
    /// let mut palette = FieldPalette::from_colors(day).unwrap();
    /// palette.blend(&day, &night, 0.5, BlendSpace::Oklab);
    /// assert_eq!(palette.shown(), [BlendSpace::Oklab.mix(Color::WHITE, Color::BLACK, 0.5)]);
    /// ```
    pub fn blend(&mut self, from: &[Color], to: &[Color], t: f32, space: BlendSpace) {
        self.shown.iter_mut().zip(space.mix_all(from, to, t)).for_each(|(shown, color)| *shown = color);
    }

    /// Sets the shown colors to the blend of the source colors and other colors: the source colors at `t` = 0 and `to`
    /// at `t` = 1. `t` is clamped to 0..=1.
    ///
    /// Replaces what [`set`](Self::set) did to these colors. Colors that `to` lacks are not changed. To recolor a field
    /// and fade it as well, [`blend`](Self::blend) from your own colors.
    pub fn blend_from_source(&mut self, to: &[Color], t: f32, space: BlendSpace) {
        self.shown.iter_mut().zip(space.mix_all(&self.source, to, t)).for_each(|(shown, color)| *shown = color);
    }

    /// Resets the shown colors to the source colors.
    pub fn reset(&mut self) {
        self.shown.clone_from(&self.source);
    }

    /// Writes the source colors and their weights to a JSON file, replacing any existing file. `path` is a file system
    /// path, not an asset path.
    ///
    /// To skip extraction at run time, save the palette next to the field: as `x.palette.json` next to `x.plenoctree`
    /// or `x.npz`.
    ///
    /// Returns an error if the file cannot be written, or if the palette is [invalid](Palette::validate).
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), PaletteFileError> {
        self.palette.write(path)
    }
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
        self.assigned.push(id);
    }

    /// Sets the palette of a field from an asset as soon as it is loaded, and again whenever it changes.
    /// [`PaletteReady`](crate::PaletteReady) is written whenever that changes the palette. If the asset fails to load,
    /// the field keeps its current palette; if it has none, one is extracted.
    ///
    /// ```
    /// # use bevy::prelude::*;
    /// # use bevy_plenoctree::{Palettes, PlenOctreePlugin, Prop};
    /// fn winter(props: Query<&Prop>, assets: Res<AssetServer>, mut palettes: ResMut<Palettes>) {
    ///     for prop in &props {
    ///         palettes.insert_handle(&prop.0, assets.load("winter.palette.json"));
    ///     }
    /// }
    /// # let mut app = App::new();
    /// # app.add_plugins((MinimalPlugins, AssetPlugin::default(), PlenOctreePlugin)).add_systems(Update, winter);
    /// # app.world_mut().spawn(Prop(Handle::default()));
    /// # app.update();
    /// ```
    pub fn insert_handle(&mut self, field: impl Into<AssetId<PlenOctree>>, palette: Handle<Palette>) {
        let id = field.into();
        self.files.insert(id, PaletteSource::Expected(palette));
        self.assigned.push(id);
    }

    /// Removes and returns the palette of a field. If a posterized prop or view uses the field, a palette is loaded
    /// from the file next to the field or extracted, as at first.
    pub fn remove(&mut self, field: impl Into<AssetId<PlenOctree>>) -> Option<FieldPalette> {
        let id = field.into();
        self.files.remove(&id);
        self.assigned.push(id);
        self.by_field.remove(&id)
    }

    /// Inserts a palette that was extracted, for which [`PaletteReady`](crate::PaletteReady) is written.
    pub(super) fn arrive(&mut self, field: AssetId<PlenOctree>, palette: FieldPalette) {
        self.files.remove(&field);
        self.by_field.insert(field, palette);
        self.arrived.push(field);
    }

    /// Returns whether a field has no palette and none is being loaded.
    pub(super) fn lacks(&self, field: AssetId<PlenOctree>) -> bool {
        !self.by_field.contains_key(&field) && matches!(self.files.get(&field), Some(PaletteSource::Missing))
    }
}
