//! The radiance field: a sparse octree whose leaves hold density and spherical-harmonic coefficients. Section 1 of the
//! method.

mod activation;
mod basis;
mod cell;
mod coefficients;
#[cfg(any(feature = "fit", feature = "splat"))]
mod finest;
mod frame;
mod octree;

pub use activation::Activation;
pub use basis::Basis;
pub use cell::{Cell, LeafCell};
pub use coefficients::Codebook;
#[cfg(feature = "write")]
pub(crate) use coefficients::from_rgb;
pub(crate) use coefficients::{Coefficients, Tables};
#[cfg(feature = "fit")]
pub(crate) use finest::morton;
#[cfg(feature = "splat")]
pub(crate) use finest::position_of;
#[cfg(any(feature = "fit", feature = "splat"))]
pub(crate) use finest::tree_of_finest;
pub use frame::{Frame, UpAxis};
pub use octree::{InvalidField, MAX_DEPTH, PlenOctree, Precision};
