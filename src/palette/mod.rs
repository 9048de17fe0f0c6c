//! The palettes of a running app: loaded, or extracted if there is no file, and edited by any system.

mod blend;
mod extraction;
mod file;
mod overrides;
mod posterized;
mod ready;
mod resource;
mod samples;
mod source;

pub use blend::BlendSpace;
#[cfg(feature = "headless")]
pub(crate) use extraction::field_name;
pub use extraction::{PaletteExtraction, PaletteSampler};
pub use file::PaletteLoader;
pub use overrides::PaletteOverride;
pub(crate) use overrides::hash_color;
pub use ready::{PaletteFailed, PaletteReady};
pub use resource::{FieldPalette, Palettes};
#[cfg(feature = "egui")]
pub(crate) use resource::{decoded, encoded};
pub use samples::{ExtractionSamples, SampleOrigin};

use bevy::{asset::AssetTrackingSystems, prelude::*};
use plenoctree::palette::{ColorCount, ExtractionSettings, Palette, PaletteMethod, RampAdjustment};

use crate::sets::PlenOctreeSystems;

/// Fills [`Palettes`]: loads or extracts the palettes that posterized props and views need.
pub(crate) struct PalettePlugin;

impl Plugin for PalettePlugin {
    fn build(&self, app: &mut App) {
        app.init_asset::<Palette>()
            .init_asset_loader::<PaletteLoader>()
            .register_asset_reflect::<Palette>()
            .init_resource::<Palettes>()
            .init_resource::<PaletteExtraction>()
            .add_message::<PaletteFailed>()
            .add_message::<PaletteReady>()
            .register_type::<ExtractionSettings>()
            .register_type::<PaletteMethod>()
            .register_type::<ColorCount>()
            .register_type::<RampAdjustment>()
            .register_type::<Palettes>()
            .register_type::<PaletteExtraction>()
            .register_type::<PaletteOverride>()
            // Runs before `Update`, so that systems there can edit a new palette before it is first shown.
            .configure_sets(
                PreUpdate,
                PlenOctreeSystems::UpdatePalettes.after(AssetTrackingSystems).after(PlenOctreeSystems::ReportFields),
            )
            .add_systems(
                PreUpdate,
                (extraction::forget, file::seek, file::load, extraction::start, extraction::finish)
                    .chain()
                    .in_set(PlenOctreeSystems::UpdatePalettes),
            );
    }
}
