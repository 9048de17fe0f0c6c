#![doc = "Stylised radiance-field props for Bevy."]
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod asset;
pub mod camera;
pub mod field;
pub mod gpu;
pub mod headless;
pub mod palette;
mod palettes;
pub mod picture;
pub mod reference;

pub use field::PlenOctree;
pub use palette::{ExtractionSettings, Palette};
pub use palettes::{FieldPalette, PaletteExtraction, Palettes};
pub use picture::{Abstraction, Posterize, Prop};

use bevy::prelude::*;

/// Everything: loading, extraction of palettes, rendering.
pub struct PlenOctreePlugin;

impl Plugin for PlenOctreePlugin {
    fn build(&self, app: &mut App) {
        app.init_asset::<PlenOctree>().init_asset_loader::<asset::PlenOctreeLoader>().add_plugins((
            gpu::GpuFieldPlugin,
            palettes::PalettesPlugin,
            picture::PicturePlugin,
        ));
    }
}
