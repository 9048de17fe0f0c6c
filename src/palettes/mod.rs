//! The palettes of a running app: read or extracted when they are missing, and changed by whoever likes to.

mod blend;
mod extraction;
mod file;
mod oklab;
mod overrides;
mod posterized;
mod ready;
mod reflect;
mod resource;

pub use blend::BlendSpace;
pub use extraction::{PaletteExtraction, Sampled, Sampler};
pub use overrides::PaletteOverride;
pub use ready::PaletteReady;
pub use resource::{FieldPalette, Palettes};

use bevy::{asset::AssetTrackingSystems, prelude::*};

use crate::palette::{ExtractionSettings, Palette};

/// Keeps [`Palettes`] filled.
pub(crate) struct PalettesPlugin;

impl Plugin for PalettesPlugin {
    fn build(&self, app: &mut App) {
        app.init_asset::<Palette>()
            .init_asset_loader::<file::PaletteLoader>()
            .init_resource::<Palettes>()
            .init_resource::<PaletteExtraction>()
            .add_message::<PaletteReady>()
            .register_type::<ExtractionSettings>()
            .register_type::<Palettes>()
            .register_type::<PaletteExtraction>()
            .register_type::<PaletteOverride>()
            .add_systems(
                // Before any system of `Update`, so that a new palette is shown as the game likes it from the start.
                PreUpdate,
                (extraction::forget, file::seek, file::load, extraction::start, extraction::finish, ready::announce)
                    .chain()
                    .after(AssetTrackingSystems),
            );
    }
}
