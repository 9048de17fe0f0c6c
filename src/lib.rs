//! Stylized radiance-field props for [Bevy](https://bevy.org).
//!
//! Loads PlenOctrees (trained radiance fields) as assets, extracts one palette from the whole field, renders the field
//! among ordinary meshes, and posterizes it with labels blended from that palette. The palette is a resource that
//! gameplay can animate, so a red cap turns blue while the look stays coherent from frame to frame.
//!
//! ```no_run
//! use bevy::prelude::*;
//! use bevy_plenoctree::prelude::*;
//!
//! App::new().add_plugins((DefaultPlugins, PlenOctreePlugin)).add_systems(Startup, setup).run();
//!
//! fn setup(mut commands: Commands, assets: Res<AssetServer>) {
//!     commands.spawn((Prop(assets.load("toadstool.npz")), Posterize::default()));
//!     commands.spawn((Camera3d::default(), Transform::from_xyz(1.5, 1.3, 3.2).looking_at(Vec3::ZERO, Vec3::Y)));
//! }
//! ```
//!
//! | to | use |
//! |---|---|
//! | show a field | [`Prop`], [`SolidOpacity`]; [`FieldReady`] and [`FieldFailed`] report how its upload went |
//! | posterize it | [`Posterize`] on the prop, or [`PosterizeView`] on a camera for everything in view |
//! | recolor it | [`Palettes`], [`PaletteOverride`], [`BlendSpace`], [`PaletteReady`] |
//! | choose how palettes are extracted | [`PaletteExtraction`] |
//! | place props in the frame, trade accuracy for speed | [`PropStage`], [`PropQuality`] on a camera |
//! | find what a ray hits | [`PropRayCast`]; `PropPickingPlugin` with the feature `picking` |
//! | add a render stage | [`LabelStages`], [`LabelTextures`], [`PlenOctreeRenderSystems`] |
//! | capture frames without a window | `headless`, with the feature of that name |
//!
//! Fields are read, written, baked and examined without an engine by the crate [`plenoctree`], from which the types of
//! fields and palettes come.
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod asset;
mod gpu;
#[cfg(feature = "headless")]
pub mod headless;
mod palette;
#[cfg(feature = "egui")]
pub mod panel;
mod picking;
mod posterize;
pub mod prelude;
mod prop;
mod quality;
pub mod render;
mod sampling;
mod sets;
mod stage;

pub use asset::PlenOctreeLoader;
pub use gpu::{FieldFailed, FieldReady, FieldTooLarge, GpuField};
pub use palette::{
    BlendSpace, ExtractionSamples, FieldPalette, PaletteExtraction, PaletteLoader, PaletteOverride, PaletteReady,
    PaletteSampler, Palettes,
};
#[cfg(feature = "picking")]
pub use picking::PropPickingPlugin;
pub use picking::{PropHit, PropRayCast};
pub use plenoctree::{
    Activation, LoadSettings, PlenOctree, Precision, UpAxis,
    palette::{ExtractionSettings, Palette, PaletteLabel},
    sampling::{Observers, SamplingSettings},
};
pub use posterize::{BilateralFilter, MAX_BLEND_STEPS, MAX_FILTER_ITERATIONS, MAX_FILTER_RADIUS, Posterize};
pub use prop::{Prop, SolidOpacity};
pub use quality::{PropQuality, QualityPreset};
pub use render::{LabelTextures, StageWrite};
pub use sets::{PlenOctreeRenderSystems, PlenOctreeSystems};
pub use stage::{LabelStages, PosterizeView, PropStage};

use bevy::prelude::*;

/// Loads fields, extracts their palettes, and draws props.
#[derive(Clone, Copy, Debug, Default)]
pub struct PlenOctreePlugin;

impl Plugin for PlenOctreePlugin {
    fn build(&self, app: &mut App) {
        app.init_asset::<PlenOctree>()
            .init_asset_loader::<PlenOctreeLoader>()
            .register_type::<LabelStages>()
            .register_type::<LoadSettings>()
            .register_type::<Posterize>()
            .register_type::<PosterizeView>()
            .register_type::<PropQuality>()
            .register_type::<PropStage>()
            .add_plugins((
                gpu::GpuFieldPlugin,
                sampling::SamplingPlugin,
                palette::PalettePlugin,
                prop::PropPlugin,
                render::RenderPropsPlugin,
            ));
    }
}

/// Compiles the snippets of the documentation.
#[cfg(doctest)]
mod documentation {
    #[doc = include_str!("../README.md")]
    struct Readme;
    #[doc = include_str!("../docs/guide.md")]
    struct Guide;
}
