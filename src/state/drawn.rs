//! Which field of a prop is drawn.

use bevy::prelude::*;
use plenoctree::PlenOctree;

use crate::{
    palette::{PaletteExtraction, Palettes},
    posterize::{BeforePalette, Posterize},
    prop::Prop,
};

/// The last field of a prop that could be drawn. If the prop is given another one, it is drawn until that one can be.
#[derive(Component, Clone, Default)]
pub(crate) struct DrawnField {
    pub(super) field: Option<Handle<PlenOctree>>,
    /// The frame in which everything that the field needs was there.
    pub(super) since: u64,
}

impl DrawnField {
    /// Returns the field to draw as long as the prop's own cannot be drawn, if it is another one.
    pub fn stand_in(&self, prop: &Prop) -> Option<&Handle<PlenOctree>> {
        self.field.as_ref().filter(|field| **field != prop.0)
    }
}

/// Returns whether a field is not drawn because its palette is not known yet.
pub(crate) fn is_held_back(
    field: &Handle<PlenOctree>,
    posterize: Option<&Posterize>,
    palettes: &Palettes,
    extraction: &PaletteExtraction,
) -> bool {
    posterize.is_some_and(|posterize| posterize.before_palette == BeforePalette::Hide)
        && palettes.get(field).is_none()
        && extraction.error(field).is_none()
}
