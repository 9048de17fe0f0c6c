//! Engine-free PlenOctrees: radiance fields in sparse octrees, with files, levels of detail, palettes and ray casts.
//!
//! | module | contents |
//! |---|---|
//! | crate root | [`PlenOctree`], the field: reading and writing files, baking, levels of detail, ray casts |
//! | [`sampling`] | radiance sampling: how much of each color is visible from outside |
//! | [`palette`] | palette extraction, palette files, and the labels blended from a palette |
//! | [`camera`] | pinhole cameras |
//! | [`random`], [`sphere`], [`srgb`] | random numbers that are the same everywhere; even directions; the encoding of sRGB |
//! | [`mod@reference`] | rendering, sampling and posterization in float64, as a reference for faster code |
//!
//! This crate implements the engine-free half of *Recolorable Posterization of Volumetric Radiance Fields Using
//! Visibility-Weighted Palette Extraction* (Tojo and Umetani, EGSR 2022). The Bevy plugin is
//! [`bevy_plenoctree`](https://docs.rs/bevy_plenoctree), and
//! [`plenoctree_fit`](https://docs.rs/plenoctree_fit) makes fields from photographs and captures.
//!
//! # Features
//!
//! | feature | adds | default |
//! |---|---|---|
//! | `bake` | fields from closures | on |
//! | `camera` | pinhole cameras | on |
//! | `mesh` | surfaces of fields as triangle meshes | on |
//! | `reference` | rendering, sampling and posterization in float64 | on |
//! | `write` | writing and packing fields | on |
//! | `bevy` | Bevy's `Asset` and `Reflect` for fields, palettes and settings | off |
//!
//! The default features are for tools. A game usually needs none of them.
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]
#![warn(missing_docs)]

#[cfg(feature = "bake")]
mod bake;
#[cfg(feature = "camera")]
pub mod camera;
mod cholesky;
mod field;
mod file;
mod histograms;
mod lod;
mod march;
#[cfg(feature = "mesh")]
mod mesh;
#[cfg(feature = "write")]
mod pack;
pub mod palette;
pub mod random;
mod ray_cast;
#[cfg(feature = "reference")]
pub mod reference;
pub mod sampling;
mod save;
pub mod sphere;
pub mod srgb;

#[cfg(feature = "bake")]
pub use bake::{BakeError, BakeSettings, bake};
pub use field::{
    Activation, Basis, Cell, Codebook, Densities, Frame, InvalidField, LABEL_OPACITY, LeafCell, MAX_DEPTH, PlenOctree,
    UpAxis,
};
#[cfg(feature = "write")]
pub use file::{DensityLoss, TooEven, WriteError};
pub use file::{LoadSettings, ReadError, ReadFault};
pub use lod::Faintness;
pub use march::Crossing;
#[cfg(feature = "mesh")]
pub use mesh::{MeshError, SurfaceMesh};
#[cfg(feature = "write")]
pub use pack::{PackError, PackSettings, Packed};
pub use ray_cast::FieldHit;
pub use save::{follow_links, move_file, remove_unfinished_files, replace_file};
