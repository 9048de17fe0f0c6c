//! Palettes by field.

use std::collections::HashMap;

use bevy::prelude::*;

use crate::{
    field::PlenOctree,
    palette::{Extraction, Palette},
};

/// The palette of every field that has one. Any system may change it in any frame; the change is in the next picture.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_plenoctree::{Palettes, PlenOctree};
/// fn paint_it_blue(field: Handle<PlenOctree>, mut palettes: ResMut<Palettes>) {
///     if let Some(palette) = palettes.get_mut(&field) {
///         palette.set(0, Color::srgb(0.1, 0.2, 0.9));
///     }
/// }
/// ```
#[derive(Resource, Default)]
pub struct Palettes {
    by_field: HashMap<AssetId<PlenOctree>, FieldPalette>,
}

/// The palette of one field: the colours that were extracted, by which pixels get their labels, and as many colours that
/// are shown in their place.
#[derive(Clone, Debug)]
pub struct FieldPalette {
    extracted: Palette,
    shown: Vec<Color>,
    extraction: Option<Extraction>,
}

impl FieldPalette {
    /// A palette that comes from elsewhere than an extraction; shown as it is.
    pub fn new(palette: Palette) -> Self {
        let mut new = Self { extracted: palette, shown: Vec::new(), extraction: None };
        new.reset();
        new
    }

    /// An extraction's palette, shown as it is.
    pub(super) fn extracted_by(extraction: Extraction) -> Self {
        Self { extraction: Some(extraction.clone()), ..Self::new(extraction.palette) }
    }

    /// The extracted colours, encoded sRGB, and their weights.
    pub fn extracted(&self) -> &Palette {
        &self.extracted
    }

    /// How the palette was extracted; `None` if it was given.
    pub fn extraction(&self) -> Option<&Extraction> {
        self.extraction.as_ref()
    }

    /// The colours that are shown, in the order of the extracted ones.
    pub fn shown(&self) -> &[Color] {
        &self.shown
    }

    /// The colours that are shown, to change.
    pub fn shown_mut(&mut self) -> &mut [Color] {
        &mut self.shown
    }

    /// Shows `color` in place of the extracted colour `index`; an index that is not there changes nothing.
    pub fn set(&mut self, index: usize, color: impl Into<Color>) {
        if let Some(shown) = self.shown.get_mut(index) {
            *shown = color.into();
        }
    }

    /// Shows the extracted colours again.
    pub fn reset(&mut self) {
        let colors = self.extracted.colors.iter().map(|c| Color::srgb(c[0] as f32, c[1] as f32, c[2] as f32));
        self.shown.clear();
        self.shown.extend(colors);
    }
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
        self.by_field.insert(field.into(), palette);
    }

    /// Takes a field's palette away. If a posterised prop shows the field, another is extracted.
    pub fn remove(&mut self, field: impl Into<AssetId<PlenOctree>>) -> Option<FieldPalette> {
        self.by_field.remove(&field.into())
    }
}
