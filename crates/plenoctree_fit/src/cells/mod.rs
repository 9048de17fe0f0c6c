//! Cells of different sizes, and the choice of those that pictures need.

mod list;
mod tree;

pub use list::{BLOCK, Cells};
#[cfg(feature = "splat")]
pub use tree::merged_thickness;
pub use tree::{Tree, price};
