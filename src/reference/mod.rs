//! The float64 reference: sections 2 to 4 of the method, written to be read.
//!
//! It needs no GPU and no app, takes its time, and judges everything faster. Nothing here is shared with the fast paths
//! but the field itself.

mod march;
mod posterize;
mod render;
mod sampling;

pub use march::{Crossing, march};
pub use posterize::{Posterization, labels, posterize};
pub use render::{Picture, render, render_ray};
pub use sampling::sample_histograms;
