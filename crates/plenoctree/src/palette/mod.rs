//! Palette extraction: section 3 of the method (Tojo and Umetani, EGSR 2022, section 4.1).
//!
//! [`extract`] samples leaves of a field from many directions, and collects the visible radiance in histograms
//! ([`sample`](crate::sampling::sample)). By default, it fits tones to what is seen of the field from outside. Other
//! methods find the palette that fits the histograms best or, as the paper does, cluster them and simplify the convex
//! hull of the clusters. It runs on all cores and needs no app. Other threads can read
//! its [`Progress`](crate::sampling::Progress) and cancel it.

mod colors;
mod errors;
mod extract;
mod fit;
mod hull;
mod kmeans;
mod label;
mod method;
mod oklab;
mod order;
mod polygon;
mod ramp;
mod ramps;
mod settings;
mod simplify;
mod space;
mod steps;
mod tones;

pub use colors::{InvalidPalette, Palette, PaletteFileError};
pub use errors::ColorErrors;
pub use extract::{
    Extraction, ExtractionError, ExtractionReport, ExtractionTimes, extract, extract_from_samples, extract_with,
};
pub use label::PaletteLabel;
pub use method::{ColorCount, PaletteMethod};
pub use ramp::{InvalidRamps, Ramp};
pub use ramps::{RampAdjustment, Unmet, UnmetReason, UnmetWishes, Wish};
pub use settings::ExtractionSettings;
pub use space::{LabelSpace, tone_space};
pub use steps::{initial_centers, k_means, simplify_hull};
