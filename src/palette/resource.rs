//! The palettes of all fields.

use std::{collections::HashMap, path::Path};

use bevy::prelude::*;
use plenoctree::{
    PlenOctree,
    palette::{
        Extraction, ExtractionReport, InvalidPalette, InvalidRamps, Palette, PaletteFileError, Ramp, RampAdjustment,
        UnmetWishes, Wish,
    },
};

use super::{blend::BlendSpace, source::PaletteSource};

/// Stores the palettes of all fields.
///
/// Any system may change a palette in any frame. Changes are visible in the same frame. Those of single colors and
/// ramps do not allocate.
///
/// If the field of a posterized or recolored prop, or of a posterized [view](crate::PosterizeView), has no palette, the
/// plugin loads one from the file
/// `x.palette.json` next to the field's `x.plenoctree` or `x.npz` or, if there is no such file, extracts one.
/// [`PaletteReady`](crate::PaletteReady) is written when it is ready. A palette that you insert takes precedence over
/// both.
///
/// Saved worlds do not contain it, because fields have other ids in every run of an app. [`FieldPalette::save`] writes
/// a palette to a file of its own, and saved worlds contain each [`PaletteOverride`](crate::PaletteOverride).
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
#[reflect(Default)]
#[type_path = "bevy_plenoctree"]
pub struct Palettes {
    pub(super) by_field: HashMap<AssetId<PlenOctree>, FieldPalette>,
    #[reflect(ignore)]
    pub(super) files: HashMap<AssetId<PlenOctree>, PaletteSource>,
    /// Fields whose palettes were inserted or removed, so that earlier requests and failures no longer matter.
    #[reflect(ignore)]
    pub(super) assigned: Vec<AssetId<PlenOctree>>,
}

/// The palette of one field.
///
/// It has two sets of colors of the same size. The *source* colors decide which pixels get which label, and recoloring
/// never changes them. The *shown* colors appear on screen in their place, and are yours to change. Colors are indexed
/// from 0, the heaviest first.
///
/// Of these, the color on screen is the last one that exists, multiplied by the entity's
/// [`PropTint`](crate::PropTint):
///
/// 1. the source colors,
/// 2. the shown colors, which all props of the field share,
/// 3. the colors of the entity's [`PaletteOverride`](crate::PaletteOverride).
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(Clone, Debug, PartialEq)]
#[type_path = "bevy_plenoctree"]
pub struct FieldPalette {
    palette: Palette,
    shown: Vec<Color>,
    #[reflect(ignore)]
    pub(super) extraction: Option<ExtractionReport>,
}

impl FieldPalette {
    /// Creates a palette that was not extracted from the field. The shown colors are [those of the
    /// palette](Palette::shown) or, if it has none, the source colors. Ramps with tones that the palette lacks are left
    /// out.
    pub fn new(mut palette: Palette) -> Self {
        let count = palette.colors.len();
        palette.ramps.retain(|ramp| ramp.tones.iter().all(|tone| *tone < count));
        let mut new = Self { shown: palette.colors.iter().map(decoded).collect(), extraction: None, palette };
        let shown = std::mem::take(&mut new.palette.shown);
        new.show(shown.iter().map(decoded));
        new
    }

    /// Creates a palette from colors of equal weight, which are converted to encoded sRGB. They are both the source
    /// colors and the shown colors. Alpha is ignored.
    ///
    /// Returns an error if there are no colors, more than [`Palette::MAX_COLORS`], or any that are not finite.
    pub fn from_colors(colors: impl IntoIterator<Item = impl Into<Color>>) -> Result<Self, InvalidPalette> {
        Palette::new(colors.into_iter().map(encoded).collect()).map(Self::new)
    }

    /// Creates the palette of an extraction. The shown colors are the source colors.
    pub(super) fn from_extraction(extraction: Extraction) -> Self {
        Self { extraction: Some(extraction.report), ..Self::new(extraction.palette) }
    }

    /// Returns the source colors. Each pixel gets the label whose blend of source colors is nearest.
    pub fn source(&self) -> impl ExactSizeIterator<Item = Color> {
        self.palette.colors.iter().map(decoded)
    }

    /// Returns the palette of the source colors: their exact values, their weights and their ramps. It has no shown
    /// colors.
    pub fn palette(&self) -> &Palette {
        &self.palette
    }

    /// Returns the palette as [`save`](Self::save) writes it: with the shown colors, unless all are the source colors.
    /// A game may store it in a file of its own, and pass it to [`new`](Self::new) later. It is
    /// [invalid](Palette::validate) if a shown color is not finite.
    pub fn to_palette(&self) -> Palette {
        let mut saved = self.palette.clone();
        if !self.source().eq(self.shown.iter().copied()) {
            let pairs = self.shown.iter().zip(&self.palette.colors);
            saved.shown =
                pairs.map(|(shown, own)| if *shown == decoded(own) { *own } else { encoded(*shown) }).collect();
        }
        saved
    }

    /// Returns how the palette was extracted, or `None` if it was loaded or inserted.
    pub fn extraction(&self) -> Option<&ExtractionReport> {
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
    /// and returns false. Alpha is ignored.
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

    /// Sets the shown colors, from color 0 on, for example to those of winter. The source colors stay, and with them
    /// the label of every pixel. Shown colors that `colors` lacks are not changed; colors that the palette lacks are
    /// left out.
    ///
    /// ```
    /// # use bevy::prelude::*;
    /// # use bevy_plenoctree::FieldPalette;
    /// # let mut palette = FieldPalette::from_colors([Srgba::BLACK, Srgba::WHITE]).unwrap();
    /// palette.show([Srgba::rgb(0.6, 0.8, 1.0)]);
    /// assert_eq!(palette.shown(), [Srgba::rgb(0.6, 0.8, 1.0).into(), Srgba::WHITE.into()]);
    /// ```
    pub fn show(&mut self, colors: impl IntoIterator<Item = impl Into<Color>>) {
        self.shown.iter_mut().zip(colors).for_each(|(shown, color)| *shown = color.into());
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
        let pairs = self.palette.colors.iter().zip(to);
        self.shown.iter_mut().zip(pairs).for_each(|(shown, (own, to))| *shown = space.mix(decoded(own), *to, t));
    }

    /// Returns the ramps: which colors are shades of one material, from shadow to highlight. Palettes of
    /// [`PaletteMethod::Tones`](crate::PaletteMethod::Tones) have some, and so do those of files that list them.
    pub fn ramps(&self) -> &[Ramp] {
        &self.palette.ramps
    }

    /// Returns the index of the ramp with a name.
    pub fn ramp(&self, name: &str) -> Option<usize> {
        self.palette.ramp(name)
    }

    /// Returns the mean source color of a ramp, which [`set_ramp`](Self::set_ramp) replaces, or `None` if there is no
    /// such ramp.
    pub fn ramp_color(&self, ramp: usize) -> Option<Color> {
        self.palette.ramp_color(ramp).as_ref().map(decoded)
    }

    /// Shows a ramp in another color: its mean becomes the color, and its contrast is kept as long as it fits between
    /// black and white. Near them, the ramp loses up to a quarter of its contrast, and then its mean gives way. Alpha
    /// is ignored. Replaces what was done to its shown colors before. If there is no such ramp, changes nothing, logs a
    /// warning (once per app), and returns false.
    ///
    /// ```
    /// # use bevy::prelude::*;
    /// # use bevy_plenoctree::{FieldPalette, Palette};
    /// # let mut source = Palette::new(vec![[0.5, 0.1, 0.1], [0.8, 0.2, 0.2]]).unwrap();
    /// # source.ramps = source.guess_ramps();
    /// # let mut palette = FieldPalette::new(source);
    /// if let Some(red) = palette.ramp("red") {
    ///     palette.set_ramp(red, Color::srgb(0.1, 0.2, 0.9));
    /// }
    /// # assert!(palette.shown().iter().all(|color| color.to_srgba().blue > color.to_srgba().red));
    /// ```
    pub fn set_ramp(&mut self, ramp: usize, color: impl Into<Color>) -> bool {
        self.adjust_ramp(ramp, &RampAdjustment::to_color(encoded(color)))
    }

    /// Shows a ramp with an adjustment of its source colors: another color, brightness, contrast or saturation.
    /// Replaces what was done to its shown colors before, so that a system may call it in every frame. It does not
    /// allocate.
    ///
    /// If there is no such ramp, changes nothing, logs a warning (once per app), and returns false.
    pub fn adjust_ramp(&mut self, ramp: usize, adjustment: &RampAdjustment) -> bool {
        let Self { palette, shown, .. } = self;
        let set = |tone: usize, color: [f64; 3]| shown[tone] = decoded(&color);
        let shown = palette.show_ramp(ramp, adjustment, set);
        if let Err(error) = &shown {
            warn_once!("cannot show a ramp of a palette: {error}");
        }
        shown.is_ok()
    }

    /// Moves ramps so that labels get given colors, as exactly as wished: those of a [`PropHit`](crate::PropHit), for
    /// example. Ramps in `locked`, and those without a wish, keep what they show.
    ///
    /// Returns an error that says which wishes cannot be met. The shown colors then come as near to all of them as
    /// possible.
    pub fn recolor(&mut self, wishes: &[Wish], locked: &[usize]) -> Result<(), UnmetWishes> {
        let before: Vec<_> = self.shown.iter().map(|color| encoded(*color)).collect();
        let (colors, result) = match self.palette.recolored(&before, wishes, locked) {
            Ok(colors) => (colors, Ok(())),
            Err(unmet) => (unmet.nearest.clone(), Err(unmet)),
        };
        let shown = self.shown.iter_mut().zip(colors.iter().zip(&before));
        shown.filter(|(_, (color, before))| color != before).for_each(|(shown, (color, _))| *shown = decoded(color));
        result
    }

    /// Changes the ramps: renames, merges or splits them, or moves tones from one to another, with the methods of
    /// [`Palette`]. Changes neither source colors nor shown colors.
    ///
    /// Returns an error, and changes nothing, if the ramps do not fit the palette afterward.
    ///
    /// ```
    /// # use bevy_plenoctree::{FieldPalette, Palette};
    /// # let mut source = Palette::new(vec![[0.5, 0.1, 0.1], [0.2, 0.2, 0.8]]).unwrap();
    /// # source.ramps = source.guess_ramps();
    /// # let mut palette = FieldPalette::new(source);
    /// palette.edit_ramps(|palette| palette.rename_ramp(0, "cap"))?;
    /// assert_eq!(palette.ramp("cap"), Some(0));
    /// # Ok::<(), bevy_plenoctree::InvalidRamps>(())
    /// ```
    pub fn edit_ramps(
        &mut self,
        edit: impl FnOnce(&mut Palette) -> Result<(), InvalidRamps>,
    ) -> Result<(), InvalidRamps> {
        let mut edited = self.palette.clone();
        edit(&mut edited)?;
        let new = Palette { ramps: edited.ramps, ..self.palette.clone() };
        // The rest may be invalid, if it was made by hand.
        new.validate_ramps()?;
        self.palette = new;
        Ok(())
    }

    /// Resets the shown colors to the source colors.
    pub fn reset(&mut self) {
        self.shown.iter_mut().zip(&self.palette.colors).for_each(|(shown, own)| *shown = decoded(own));
    }

    /// Writes the palette to a JSON file, replacing any existing file: the source colors, their weights and ramps, and
    /// the shown colors, unless all are the source colors. `path` is a file system path, not an asset path.
    ///
    /// To skip extraction at run time, save the palette next to the field: as `x.palette.json` next to `x.plenoctree`
    /// or `x.npz`. It then shows what it showed when it was saved; to ship a palette without the colors of a player,
    /// [`reset`](Self::reset) a clone of it.
    ///
    /// Returns an error in the cases of [`Palette::write`]: if a channel of a source color is not from 0 to 1, for
    /// example.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), PaletteFileError> {
        self.to_palette().write(path)
    }
}

/// Returns a color as the channels of encoded sRGB that palettes have.
pub(crate) fn encoded(color: impl Into<Color>) -> [f64; 3] {
    Srgba::from(color.into()).to_f32_array_no_alpha().map(f64::from)
}

/// Returns the color of channels in encoded sRGB.
pub(crate) fn decoded(color: &[f64; 3]) -> Color {
    Color::srgb(color[0] as f32, color[1] as f32, color[2] as f32)
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

    /// Returns the fields that have a palette, and their palettes, in any order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (AssetId<PlenOctree>, &FieldPalette)> {
        self.by_field.iter().map(|(field, palette)| (*field, palette))
    }

    /// Sets the palette of a field, instead of loading or extracting one. Cancels an extraction that was requested in an
    /// earlier frame.
    pub fn insert(&mut self, field: impl Into<AssetId<PlenOctree>>, palette: FieldPalette) {
        let id = field.into();
        self.files.remove(&id);
        // Hot reloading replaces palettes that were extracted.
        self.by_field.insert(id, FieldPalette { extraction: None, ..palette });
        self.assigned.push(id);
    }

    /// Sets the palette of a field from an asset as soon as it is loaded, and again whenever it changes.
    /// [`PaletteReady`](crate::PaletteReady) is written whenever that changes the palette. If the asset fails to load,
    /// the field keeps its current palette; if it has none, one is extracted. A default handle counts as one that
    /// fails.
    ///
    /// Call it once: every call sets the palette again, so that changes of its shown colors are lost.
    ///
    /// ```
    /// # use bevy::prelude::*;
    /// # use bevy_plenoctree::{Palettes, PlenOctreePlugin, Prop};
    /// # let mut app = App::new();
    /// # app.add_plugins((MinimalPlugins, AssetPlugin::default(), PlenOctreePlugin));
    /// fn snow(props: Query<&Prop>, assets: Res<AssetServer>, mut palettes: ResMut<Palettes>) {
    ///     for prop in &props {
    ///         palettes.insert_handle(&prop.0, assets.load("toadstool_in_snow.palette.json"));
    ///     }
    /// }
    /// app.add_systems(Update, snow.run_if(run_once));
    /// # app.world_mut().spawn(Prop(Handle::default()));
    /// # app.update();
    /// ```
    pub fn insert_handle(&mut self, field: impl Into<AssetId<PlenOctree>>, palette: Handle<Palette>) {
        let id = field.into();
        self.files.insert(id, PaletteSource::Expected(palette));
        self.assigned.push(id);
    }

    /// Removes and returns the palette of a field. If a posterized or recolored prop or a posterized view uses the
    /// field, a palette is loaded from the file next to the field or extracted, as at first.
    pub fn remove(&mut self, field: impl Into<AssetId<PlenOctree>>) -> Option<FieldPalette> {
        let id = field.into();
        self.files.remove(&id);
        self.assigned.push(id);
        self.by_field.remove(&id)
    }

    /// Inserts a palette that was extracted, for which [`PaletteReady`](crate::PaletteReady) is written.
    pub(super) fn arrive(&mut self, field: AssetId<PlenOctree>, palette: FieldPalette) {
        if !matches!(self.files.get(&field), Some(PaletteSource::Failed(_))) {
            self.files.remove(&field);
        }
        self.by_field.insert(field, palette);
    }

    /// Returns whether a field has no palette and none is being loaded.
    pub(super) fn lacks(&self, field: AssetId<PlenOctree>) -> bool {
        let has_no_file = matches!(self.files.get(&field), Some(PaletteSource::Missing | PaletteSource::Failed(_)));
        has_no_file && !self.by_field.contains_key(&field)
    }

    /// Returns whether a field has a palette that was extracted, and is given no other one.
    pub(super) fn keeps_extracted(&self, field: AssetId<PlenOctree>) -> bool {
        let is_loading = matches!(self.files.get(&field), Some(PaletteSource::Expected(_) | PaletteSource::Changed(_)));
        !is_loading && self.get(field).is_some_and(|palette| palette.extraction().is_some())
    }
}
