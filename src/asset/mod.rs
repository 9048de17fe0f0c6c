//! Fields as assets: loaders of fields and captures, their progress, and the asset processor that packs them.

#[cfg(feature = "splat")]
mod capture;
mod loader;
#[cfg(feature = "pack")]
mod pack;
mod progress;
#[cfg(any(feature = "pack", feature = "splat"))]
mod turn;

#[cfg(feature = "splat")]
pub use capture::{CaptureLoader, CaptureSettings};
pub use loader::PlenOctreeLoader;
#[cfg(feature = "pack")]
pub use pack::PackSaver;
#[cfg(feature = "pack")]
pub(crate) use pack::register as register_processor;
pub(crate) use progress::FilesRead;
