//! The float64 reference: sections 2 to 4 of the method, in code that is meant to be read.
//!
//! It needs neither a GPU nor an app, and does not try to be fast. Faster implementations are tested against it. The
//! only code that it shares with them is the field itself, and the space of tones.

mod histograms;
mod posterize;
mod render;

pub use histograms::sample_histograms;
pub use posterize::{Posterization, cielab, filter, labels, posterize, shown_opacity};
pub use render::{Rendering, render};
