//! The radiance field: a sparse octree whose leaves hold density and spherical-harmonic coefficients. Section 1 of the
//! method.

mod activation;
mod basis;
mod cell;
mod frame;
mod octree;

pub use activation::Activation;
pub use basis::Basis;
pub use cell::{Cell, LeafCell};
pub use frame::{Frame, UpAxis};
pub use octree::{InvalidField, MAX_DEPTH, PlenOctree, Precision};
