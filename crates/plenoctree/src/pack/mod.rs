//! Packing: converts a field to its shipping form, which is a tenth of the size.
//!
//! Leaves that no ray sees are dropped. Densities and the coefficients of the constant function become integers, and
//! the other coefficients become rows of two codebooks that all leaves share. To keep pictures nearly unchanged, leaves
//! that are more visible are rounded less. `file/packed` writes the numbers to a file.

#[cfg(feature = "write")]
mod codebook;
#[cfg(feature = "write")]
mod colors;
#[cfg(feature = "write")]
mod density;
#[cfg(feature = "write")]
mod leaves;
#[cfg(feature = "write")]
mod metric;
#[cfg(feature = "write")]
mod packed;
mod quantized;
mod recent;
#[cfg(feature = "write")]
mod reuse;
#[cfg(feature = "write")]
mod search;
#[cfg(feature = "write")]
mod settings;
#[cfg(feature = "write")]
mod split;

#[cfg(feature = "write")]
pub use packed::{PackError, Packed};
pub(crate) use quantized::{COLOR_RANGES, MAX_LEVELS, MAX_ROWS, Quantized};
pub(crate) use recent::{RECENT, Recent};
#[cfg(feature = "write")]
pub use settings::PackSettings;
#[cfg(feature = "write")]
pub(crate) use split::shared;
