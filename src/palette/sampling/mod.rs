//! Visibility-weighted radiance samples: steps 1 to 5 of section 3 of the method.
//!
//! All leaves are looked at from the same few directions. Rays from the centers of equal cells in one direction cross the
//! lattice of cells in the same way, so the way is found once (`path`) and followed for the leaves of a block of
//! 8 x 8 x 8 cells together, eight in a row (`bricks`). Leaves that are coarser than the finest cells, and trees that are
//! too deep for a lattice, are marched ray by ray (`march`).

mod bricks;
mod directions;
mod leaves;
mod march;
mod path;
mod progress;
mod sampler;

pub(crate) use directions::observers;
pub(crate) use leaves::{chosen_leaves, weight_bound};
pub use progress::{Canceled, Progress};
pub(super) use sampler::sample_unchecked;
pub use sampler::{SamplingError, sample};
