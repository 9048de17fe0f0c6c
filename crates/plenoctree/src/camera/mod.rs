//! Pinhole cameras: their rays, and reading them from `transforms.json` files.

mod around;
mod pinhole;
mod spiral;
mod transforms;

pub use pinhole::PinholeCamera;
pub use spiral::Spiral;
pub use transforms::{CameraError, read_transforms};
#[cfg(feature = "fit")]
pub(crate) use transforms::{Intrinsics, WrongValue, pose, without_mark};
