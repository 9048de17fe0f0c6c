//! The float64 reference: sections 2 to 4 of the method, written to be read.
//!
//! It needs no GPU and no app, takes its time, and judges everything faster. Nothing here is shared with the fast paths
//! but the field itself.

mod histograms;
mod posterize;
mod render;

pub use histograms::sample_histograms;
pub use posterize::{Posterization, labels, posterize};
pub use render::{Rendering, render};
