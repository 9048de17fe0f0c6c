//! Pinhole cameras and their rays.

mod around;
mod pinhole;
mod spiral;

pub use pinhole::PinholeCamera;
pub use spiral::Spiral;
