//! Stylized radiance-field props for [Bevy](https://bevy.org).
//!
//! The plugin loads PlenOctrees (trained radiance fields) as assets, extracts one palette per field, renders fields
//! among ordinary meshes, and posterizes them with their palettes. Palettes can change in any frame, so gameplay can
//! turn a red cap blue while all regions stay coherent from frame to frame.
//!
#![cfg_attr(
    feature = "doc-images",
    doc = "![A toadstool house as trained, in the paper's look, as a cartoon, with its red turned blue, and as a comic][looks]\n",
    doc = "![Four props in a room with lamps and glass][scene]\n",
    doc = ::embed_doc_image::embed_image!("looks", "docs/looks.png"),
    doc = ::embed_doc_image::embed_image!("scene", "docs/scene.png")
)]
//!
//! ```no_run
//! use bevy::prelude::*;
//! use bevy_plenoctree::prelude::*;
//!
//! App::new().add_plugins((DefaultPlugins, PlenOctreePlugin)).add_systems(Startup, setup).run();
//!
//! fn setup(mut commands: Commands, assets: Res<AssetServer>) {
//!     commands.spawn((Prop(assets.load("toadstool.plenoctree")), Posterize::default()));
//!     commands.spawn((Camera3d::default(), Transform::from_xyz(1.5, 1.3, 3.2).looking_at(Vec3::ZERO, Vec3::Y)));
//! }
//! ```
//!
//! | to | use |
//! |---|---|
//! | draw a field | [`Prop`], [`SolidOpacity`] |
//! | reference a field by its path, in glTF extras (Blender) or text scenes | [`PropPath`] |
//! | know whether it is drawn | [`PropState`], [`PropProgress`], [`props_progress`], [`props_ready`], [`FieldReady`], [`FieldFailed`], [`PaletteFailed`], [`ViewFailed`] |
//! | limit the time per frame that arriving fields take | [`UploadBudget`] |
//! | survive the loss of the GPU device | [`DeviceRecoveryPlugin`] |
//! | posterize it | [`Posterize`] on the prop, or [`PosterizeView`] on a camera to posterize everything in view |
//! | draw lines | [`Ink`] on the prop, or on a camera |
//! | keep its silhouette hard | [`EdgeSmoothing`], in its [`Posterize`] |
//! | recolor it as trained | [`Recolor`] on the prop |
//! | recolor it | [`Palettes`], [`PaletteOverride`], [`PropTint`], [`BlendSpace`], [`PaletteReady`] |
//! | configure palette extraction, and see where the field was sampled | [`PaletteExtraction`], [`SampleOrigin`] |
//! | cast shadows | the feature `shadows`, [`SolidOpacity`], [`PropQuality`] on a light |
//! | let the scene's shadows and lights darken, tint or brighten it | [`PropLighting`] (feature `shadows`) on the prop |
//! | let it fade in fog | Bevy's `DistanceFog` on a camera (feature `shadows`) |
//! | choose where in the frame props are drawn | [`PropPlacement`] on a camera |
//! | trade accuracy for speed | [`PropQuality`] on a camera |
//! | cast rays at props | [`PropRayCast`]; [`PropPickingPlugin`] (feature `picking`) |
//! | add a render stage | [`LabelStages`] |
//! | load captures of Gaussian splats | [`CaptureLoader`] (feature `splat`) |
//! | ship small files | [`PackSaver`] (feature `pack`) |
//! | make colliders | [`surface_mesh`] (feature `mesh`) |
//! | capture frames without a window, and click on props in tests | the module [`headless`] (feature `headless`) |
//! | edit palettes in a window | the module [`panel`] (feature `egui`) |
//!
//! The crate [`plenoctree`], which is re-exported, provides the types of fields and palettes. It also reads, writes,
//! bakes and inspects fields without an engine.
//!
//! # Features
//!
//! All are off by default.
//!
//! | feature | adds | enables |
//! |---|---|---|
//! | `doc-images` | pictures in this documentation | `embed-doc-image` |
//! | `egui` | the module [`panel`]: a panel to edit palettes and settings | `bevy_egui` |
//! | `headless` | the module [`headless`]: an app without a window that captures frames | `image`, and the feature `camera` of `plenoctree` |
//! | `headless-lit` | `headless::LitMeshPlugins`: lights and materials for that app | `headless`, and Bevy's `bevy_pbr`, `bevy_post_process` and `bevy_gizmos_render` |
//! | `mesh` | [`surface_mesh`]: the surface of a field as a mesh, for colliders and navigation | Bevy's `bevy_mesh`, and the feature `mesh` of `plenoctree` |
//! | `pack` | [`PackSaver`]: Bevy's asset processor packs `.npz` files and captures | `async-lock`, and the feature `write` of `plenoctree` |
//! | `picking` | [`PropPickingPlugin`]: a backend for `bevy_picking` | Bevy's `bevy_picking` |
//! | `shadows` | shadows that props cast, [`PropLighting`] for shadows and lights that fall on them, and fog | Bevy's `bevy_pbr` |
//! | `splat` | [`CaptureLoader`]: captures of Gaussian splats as assets | `async-lock`, `plenoctree_fit` and `serde` |
//!
//! [`CaptureLoader`]: https://docs.rs/bevy_plenoctree/latest/bevy_plenoctree/struct.CaptureLoader.html
//! [`PackSaver`]: https://docs.rs/bevy_plenoctree/latest/bevy_plenoctree/struct.PackSaver.html
//! [`PropLighting`]: https://docs.rs/bevy_plenoctree/latest/bevy_plenoctree/struct.PropLighting.html
//! [`PropPickingPlugin`]: https://docs.rs/bevy_plenoctree/latest/bevy_plenoctree/struct.PropPickingPlugin.html
//! [`headless`]: https://docs.rs/bevy_plenoctree/latest/bevy_plenoctree/headless
//! [`panel`]: https://docs.rs/bevy_plenoctree/latest/bevy_plenoctree/panel
//! [`surface_mesh`]: https://docs.rs/bevy_plenoctree/latest/bevy_plenoctree/fn.surface_mesh.html
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod asset;
mod background;
mod camera;
mod gpu;
#[cfg(feature = "headless")]
pub mod headless;
mod ink;
#[cfg_attr(not(feature = "shadows"), allow(dead_code, reason = "only this feature lights props"))]
mod lighting;
#[cfg(feature = "mesh")]
mod mesh;
mod palette;
#[cfg(feature = "egui")]
pub mod panel;
mod picking;
mod posterize;
pub mod prelude;
mod prop;
mod quality;
mod recolor;
mod recovery;
mod render;
mod sampling;
mod sets;
mod state;
#[cfg(test)]
mod tests;

#[cfg(feature = "pack")]
pub use asset::PackSaver;
pub use asset::PlenOctreeLoader;
#[cfg(feature = "splat")]
pub use asset::{CaptureLoader, CaptureSettings};
pub use camera::{LabelStages, PosterizeView, PropPlacement};
pub use gpu::{
    FieldFailed, FieldReady, FieldTooLarge, GpuField, MAX_PROPS_IN_VIEW, UploadBudget, ViewFailed, ViewTooLarge,
};
pub use ink::{Ink, InkBorders, InkColor, MAX_INK_PIXELS};
#[cfg(feature = "shadows")]
pub use lighting::{MAX_BANDS, MAX_BRIGHTNESS, PropLighting};
#[cfg(feature = "mesh")]
pub use mesh::surface_mesh;
pub use palette::{
    BlendSpace, ExtractionSamples, FieldPalette, PaletteExtraction, PaletteFailed, PaletteLoader, PaletteOverride,
    PaletteReady, PaletteSampler, Palettes, SampleOrigin,
};
#[cfg(feature = "picking")]
pub use picking::PropPickingPlugin;
pub use picking::{PropHit, PropRayCast};
pub use plenoctree;
#[cfg(feature = "pack")]
pub use plenoctree::PackSettings;
pub use plenoctree::{
    Activation, LoadSettings, PlenOctree, UpAxis,
    palette::{
        ColorCount, ExtractionSettings, InvalidRamps, Palette, PaletteLabel, PaletteMethod, Ramp, RampAdjustment,
        Unmet, UnmetReason, UnmetWishes, Wish,
    },
    sampling::{ObserverRegion, SamplingSettings},
};
#[cfg(feature = "mesh")]
pub use plenoctree::{MeshError, SurfaceMesh};
#[cfg(feature = "splat")]
pub use plenoctree_fit::splat::{Axis, SplatError, SpzAxes};
pub use posterize::{
    BeforePalette, BilateralFilter, BorderSmoothing, EdgeSmoothing, MAX_BLEND_STEPS, MAX_FILTER_ITERATIONS,
    MAX_FILTER_RADIUS, Posterize,
};
pub use prop::{Prop, PropError, PropPath, PropProgress, PropState, PropTint, SolidOpacity};
pub use quality::PropQuality;
pub use recolor::Recolor;
pub use recovery::DeviceRecoveryPlugin;
#[cfg(feature = "shadows")]
pub use render::{LIGHTING_SPANS, SHADOW_SPANS};
pub use render::{POSTERIZE_SPANS, VOLUME_SPANS};
pub use sets::{PlenOctreeRenderSystems, PlenOctreeSystems};
pub use state::{props_progress, props_ready};

use bevy::{asset::ReflectHandle, prelude::*};

/// A plugin that loads fields, extracts their palettes, and draws [`Prop`]s.
///
/// Add it after Bevy's `DefaultPlugins`.
#[derive(Clone, Copy, Debug, Default)]
pub struct PlenOctreePlugin;

impl Plugin for PlenOctreePlugin {
    fn build(&self, app: &mut App) {
        #[cfg(feature = "pack")]
        asset::register_processor(app);
        #[cfg(feature = "splat")]
        app.init_asset_loader::<CaptureLoader>();
        app.init_asset::<PlenOctree>()
            .init_asset_loader::<PlenOctreeLoader>()
            .register_asset_reflect::<PlenOctree>()
            // What saved worlds need to hold the handles of `LabelStages`: shaders are not reflected.
            .register_type::<Handle<Shader>>()
            .register_type_data::<Handle<Shader>, ReflectHandle>()
            .register_type::<Ink>()
            .register_type::<LabelStages>()
            .register_type::<LoadSettings>()
            .register_type::<Posterize>()
            .register_type::<PosterizeView>()
            .register_type::<PropQuality>()
            .register_type::<PropPlacement>()
            .register_type::<Recolor>()
            .add_plugins((
                gpu::GpuFieldPlugin,
                sampling::SamplingPlugin,
                palette::PalettePlugin,
                prop::PropPlugin,
                state::PropStatePlugin,
                render::RenderPropsPlugin,
            ));
        #[cfg(feature = "shadows")]
        app.register_type::<PropLighting>();
    }
}

/// Compiles the code blocks in the Markdown documentation.
#[cfg(doctest)]
mod documentation {
    #[doc = include_str!("../README.md")]
    struct Readme;
    #[doc = include_str!("../docs/guide/extend.md")]
    struct Extend;
    #[doc = include_str!("../docs/guide/light.md")]
    struct Light;
    #[doc = include_str!("../docs/guide/load.md")]
    struct Load;
    #[doc = include_str!("../docs/guide/looks.md")]
    struct Looks;
    #[doc = include_str!("../docs/guide/place.md")]
    struct Place;
    #[doc = include_str!("../docs/guide/recolor.md")]
    struct Recolor;
    #[doc = include_str!("../docs/guide/test.md")]
    struct Test;
    #[doc = include_str!("../docs/guide/worlds.md")]
    struct Worlds;
}
