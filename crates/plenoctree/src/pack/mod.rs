//! Packing: converts a field to its shipping form, which is a tenth of the size.
//!
//! Leaves that no ray sees are dropped. Densities and the coefficients of the constant function become integers, and
//! the other coefficients become rows of two codebooks that all leaves share. To keep pictures nearly unchanged, leaves
//! that are more visible are rounded less. `file/packed` writes the numbers to a file.

mod codebook;
mod colors;
mod density;
mod leaves;
mod metric;
mod packed;
mod reuse;
mod search;
mod settings;
mod split;
mod write_npz;

pub use packed::{PackError, Packed};
pub use settings::PackSettings;
