//! Packing: from a field to its shipping form, which is a tenth as large.
//!
//! What no ray sees is dropped. Densities and the colors of the constant function become whole numbers, and the other
//! coefficients rows of two codebooks that all leaves share, so that pictures change little: what is seen better is rounded
//! less. `file/packed` turns the numbers into a file.

#[cfg(feature = "write")]
mod codebook;
#[cfg(feature = "write")]
mod colors;
#[cfg(feature = "write")]
mod density;
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
