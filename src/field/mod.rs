//! The radiance field: a sparse octree whose leaves hold density and spherical harmonics.
//!
//! Nothing here needs an app: fields are read, written, baked and looked into with plain functions. The module knows
//! nothing of Bevy; [`crate::asset`] makes a Bevy asset of it.

mod activation;
mod bake;
mod basis;
mod coarser;
mod error;
mod leaves;
mod npy;
mod npz;
mod octree;
mod quantized;
mod read;
mod thinned;
mod walk;
mod write;

pub use activation::Activation;
pub use bake::{BakeError, BakeSettings, bake};
pub use basis::Basis;
pub use error::{ReadError, ReadFault, WriteError};
pub use octree::{Cell, Frame, InvalidField, LeafCell, MAX_DEPTH, PlenOctree, Precision, UpAxis};
pub use read::LoadSettings;
