#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod asset;
pub mod camera;
pub mod field;
pub mod gpu;
pub mod headless;
pub mod palette;
mod palettes;
#[cfg(feature = "egui")]
pub mod panel;
pub mod picture;
pub mod prop;
pub mod reference;
mod sampling;

pub use field::PlenOctree;
pub use palette::{ExtractionSettings, Palette};
pub use palettes::{
    BlendSpace, FieldPalette, PaletteExtraction, PaletteOverride, PaletteReady, Palettes, Sampled, Sampler,
};
pub use prop::{Abstraction, Posterize, Prop};

use bevy::prelude::*;

/// Everything: loading, extraction of palettes, rendering.
pub struct PlenOctreePlugin;

impl Plugin for PlenOctreePlugin {
    fn build(&self, app: &mut App) {
        app.init_asset::<PlenOctree>()
            .init_asset_loader::<asset::PlenOctreeLoader>()
            .register_type::<field::LoadSettings>()
            .add_plugins((
                gpu::GpuFieldPlugin,
                sampling::SamplingPlugin,
                palettes::PalettesPlugin,
                prop::PropPlugin,
                picture::PicturePlugin,
            ));
    }
}
