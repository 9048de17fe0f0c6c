//! Levels of detail: the same field with larger cells, or without its faintest leaves.

mod coarser;
mod faintness;
mod thinned;

pub use faintness::Faintness;
