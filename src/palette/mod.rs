//! The palettes of a running app: read or extracted when they are missing, and changed by whoever likes to.

mod blend;
mod extraction;
mod file;
mod oklab;
mod overrides;
mod posterized;
mod ready;
mod resource;
mod source;

pub use blend::BlendSpace;
pub use extraction::{ExtractionSamples, PaletteExtraction, PaletteSampler};
pub use file::PaletteLoader;
pub use overrides::PaletteOverride;
pub use ready::PaletteReady;
pub use resource::{FieldPalette, Palettes};

use bevy::{asset::AssetTrackingSystems, prelude::*};
use plenoctree::palette::{ExtractionSettings, Palette};

use crate::sets::PlenOctreeSystems;

/// Keeps [`Palettes`] filled.
pub(crate) struct PalettePlugin;

impl Plugin for PalettePlugin {
    fn build(&self, app: &mut App) {
        app.init_asset::<Palette>()
            .init_asset_loader::<PaletteLoader>()
            .init_resource::<Palettes>()
            .init_resource::<PaletteExtraction>()
            .add_message::<PaletteReady>()
            .register_type::<ExtractionSettings>()
            .register_type::<Palettes>()
            .register_type::<PaletteExtraction>()
            .register_type::<PaletteOverride>()
            // Before any system of `Update`, so that a new palette is shown as the game likes it from the start.
            .configure_sets(PreUpdate, PlenOctreeSystems::UpdatePalettes.after(AssetTrackingSystems))
            .add_systems(
                PreUpdate,
                (extraction::forget, file::seek, file::load, extraction::start, extraction::finish, ready::announce)
                    .chain()
                    .in_set(PlenOctreeSystems::UpdatePalettes),
            );
    }
}
