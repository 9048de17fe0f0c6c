//! Reading and writing PlenOctree files: packed fields, and the `.npz` archives of svox, plenoctree, volrend and svox2.

#[cfg(feature = "write")]
mod density;
mod error;
mod frame;
mod histograms;
mod leaves;
mod npy;
mod npz;
mod packed;
mod quantized;
mod read;
mod room;
mod walk;
#[cfg(feature = "write")]
mod write;

#[cfg(feature = "write")]
pub use density::DensityLoss;
pub use error::{ReadError, ReadFault};
#[cfg(feature = "write")]
pub(crate) use frame::check_frame;
#[cfg(feature = "write")]
pub(crate) use packed::{COLOR_RANGES, MAX_LEVELS, MAX_ROWS, Quantized, RECENT, Recent};
pub use read::LoadSettings;
#[cfg(feature = "write")]
pub use room::TooEven;
#[cfg(feature = "write")]
pub use write::WriteError;
#[cfg(feature = "write")]
pub(crate) use write::{Archive, check_written, half_density};
