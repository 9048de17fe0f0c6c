//! The palettes of a running app: extracted when they are missing, and changed by whoever likes to.

mod extraction;
mod resource;

pub use extraction::PaletteExtraction;
pub use resource::{FieldPalette, Palettes};

use bevy::prelude::*;

/// Keeps [`Palettes`] filled.
pub(crate) struct PalettesPlugin;

impl Plugin for PalettesPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Palettes>()
            .init_resource::<PaletteExtraction>()
            .add_systems(Update, (extraction::forget, extraction::start, extraction::finish).chain());
    }
}
