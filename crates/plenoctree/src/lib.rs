//! PlenOctrees without an engine: radiance fields in sparse octrees, their files, their palettes.
//!
//! | module | what it does |
//! |---|---|
//! | the root | [`PlenOctree`], the field: reading and writing files, baking, levels of detail, ray casts |
//! | [`sampling`] | how much of each color is visible from outside, on all cores |
//! | [`palette`] | one palette of the whole field, its file, and the labels that are blended from it |
//! | [`camera`] | pinhole cameras, and the `transforms.json` of NeRF datasets |
//! | [`mod@reference`] | rendering, sampling and posterization in float64, to judge faster ones by |
//!
//! The crate implements the engine-free half of *Recolorable Posterization of Volumetric Radiance Fields Using
//! Visibility-Weighted Palette Extraction* (Tojo and Umetani, EGSR 2022). The Bevy plugin is
//! [`bevy_plenoctree`](https://docs.rs/bevy_plenoctree).
//!
//! # Features
//!
//! On by default, since tools want them; a game needs none: `bake`, `camera`, `reference`, `write`. Off by default: `bevy`
//! derives `Asset` and `Reflect`.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

#[cfg(feature = "bake")]
mod bake;
#[cfg(feature = "camera")]
pub mod camera;
mod field;
mod file;
mod lod;
mod march;
pub mod palette;
mod ray_cast;
#[cfg(feature = "reference")]
pub mod reference;
pub mod sampling;

#[cfg(feature = "bake")]
pub use bake::{BakeError, BakeSettings, bake};
pub use field::{Activation, Basis, Cell, Frame, InvalidField, LeafCell, MAX_DEPTH, PlenOctree, Precision, UpAxis};
#[cfg(feature = "write")]
pub use file::WriteError;
pub use file::{LoadSettings, ReadError, ReadFault};
pub use lod::Faintness;
pub use march::Crossing;
pub use ray_cast::FieldHit;
