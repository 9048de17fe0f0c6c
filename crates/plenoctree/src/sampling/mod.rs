//! Radiance sampling: how much of each color is visible from outside. Section 3 of the method, steps 1 to 5.
//!
//! All leaves are seen from the same few directions. Rays in one direction from the centers of equal cells cross the
//! lattice of cells in the same way. Their path is therefore computed once (`path`) and followed for all leaves of a
//! block of 8 x 8 x 8 cells together, eight in a row (`blocks`). In trees that are too deep for a lattice, and from leaves
//! that are far from each other, rays are marched one by one (`march`).

mod blocks;
mod choose_point;
mod directions;
mod lattice;
mod leaves;
mod march;
mod path;
mod plan;
mod progress;
#[cfg(feature = "write")]
mod record;
mod sample_point;
mod sampler;
mod views;
#[cfg(feature = "write")]
mod visibility;

pub(crate) use crate::histograms::{Bins, Recorded};
pub use crate::histograms::{
    Histograms, InvalidHistogram, InvalidSetting, MAX_CHANNEL, ObserverRegion, SamplingSettings,
};
pub use lattice::Lattice;
pub use plan::SamplingPlan;
pub use progress::{Canceled, Progress};
pub use sample_point::SamplePoint;
pub use sampler::{SamplingError, sample};
pub use views::{View, ViewRays};
#[cfg(feature = "write")]
pub(crate) use visibility::{Seen, Visibility, visibility};
