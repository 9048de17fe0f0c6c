//! The colors of the field that a prop shows until its own one can be drawn.

use bevy::prelude::*;

use crate::palette::PaletteOverride;

/// What a prop overrides of the palette of its [`DrawnField`](crate::prop::DrawnField). Once the prop has another field,
/// its [`PaletteOverride`] may be meant for that one.
#[derive(Component, Clone)]
pub(crate) struct DrawnOverride(pub PaletteOverride);
