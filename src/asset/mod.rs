//! Fields as assets: their loader, its progress, and the asset processor that packs them.

mod loader;
#[cfg(feature = "pack")]
mod pack;
mod progress;
#[cfg(not(target_arch = "wasm32"))]
mod remote;

pub use loader::PlenOctreeLoader;
#[cfg(feature = "pack")]
pub use pack::PackSaver;
#[cfg(feature = "pack")]
pub(crate) use pack::register as register_processor;
pub(crate) use progress::FilesRead;
