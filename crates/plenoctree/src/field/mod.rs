//! The radiance field: a sparse octree whose leaves hold density and spherical-harmonic coefficients. Section 1 of the
//! method.

mod activation;
mod basis;
mod cell;
mod coefficients;
mod densities;
mod frame;
mod octree;

pub use activation::Activation;
pub use basis::Basis;
pub use cell::{Cell, LeafCell};
pub use coefficients::Codebook;
#[cfg(feature = "write")]
pub(crate) use coefficients::from_rgb;
pub(crate) use coefficients::{Coefficients, Tables};
pub use densities::Densities;
pub use frame::{Frame, UpAxis};
pub(crate) use octree::NodePath;
pub use octree::{InvalidField, LABEL_OPACITY, MAX_DEPTH, PlenOctree};
