//! Reading and writing PlenOctree files: the `.npz` archives of svox, plenoctree, volrend and svox2.

mod error;
mod leaves;
mod npy;
mod npz;
mod quantized;
mod read;
mod walk;
#[cfg(feature = "write")]
mod write;

pub use error::{ReadError, ReadFault};
pub use read::LoadSettings;
#[cfg(feature = "write")]
pub use write::WriteError;
