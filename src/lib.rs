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
#[cfg(feature = "picking")]
mod picking;
pub mod picture;
pub mod prop;
pub mod quality;
mod ray_cast;
pub mod reference;
mod sampling;
pub mod view;

pub use field::PlenOctree;
pub use palette::{ExtractionSettings, Label, Palette};
pub use palettes::{
    BlendSpace, FieldPalette, PaletteExtraction, PaletteOverride, PaletteReady, Palettes, Sampled, Sampler,
};
#[cfg(feature = "picking")]
pub use picking::PropPickingPlugin;
pub use prop::{Abstraction, Posterize, Prop, SolidOpacity};
pub use quality::{Preset, Quality};
pub use ray_cast::{FieldHit, PropHit, PropRayCast};
pub use view::{PosterizeView, PropStage};

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
                view::ViewPlugin,
                picture::PicturePlugin,
            ));
    }
}
