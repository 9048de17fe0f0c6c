//! Radiance sampling: how much of each color is visible from outside. Section 3 of the method, steps 1 to 5.
//!
//! All leaves are seen from the same few directions. Rays in one direction from the centers of equal cells cross the
//! lattice of cells in the same way. Their path is therefore computed once (`path`) and followed for all leaves of a
//! block of 8 x 8 x 8 cells together, eight in a row (`blocks`). Leaves larger than the finest cells, and trees too
//! deep for a lattice, are marched ray by ray (`march`).

mod blocks;
mod directions;
mod histogram;
mod leaves;
mod march;
mod path;
mod plan;
mod progress;
mod recorded;
mod sampler;
mod settings;
#[cfg(feature = "write")]
mod visibility;

pub(crate) use directions::observers;
pub(crate) use histogram::Bins;
pub use histogram::{Histograms, InvalidHistogram, MAX_CHANNEL};
pub use plan::SamplingPlan;
pub use progress::{Canceled, Progress};
pub(crate) use recorded::Recorded;
pub use sampler::{SamplingError, sample};
pub use settings::{InvalidSetting, ObserverRegion, SamplingSettings};
#[cfg(feature = "write")]
pub(crate) use visibility::{Seen, Visibility, visibility};
