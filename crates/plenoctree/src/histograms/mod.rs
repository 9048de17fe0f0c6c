//! The histograms of the colors of a field, and how they are sampled.

mod histogram;
mod recorded;
mod settings;

pub(crate) use histogram::{Bins, Tally, shares};
pub use histogram::{Histograms, InvalidHistogram, MAX_CHANNEL};
pub(crate) use recorded::Recorded;
pub use settings::{InvalidSetting, ObserverRegion, SamplingSettings};
