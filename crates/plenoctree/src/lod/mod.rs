//! Levels of detail: versions of a field with larger cells, or without faint leaves.

mod coarser;
mod faintness;
mod thinned;

pub use faintness::Faintness;
#[cfg(feature = "write")]
pub(crate) use faintness::lost;
