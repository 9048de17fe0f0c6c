//! Renders views of a field as trained and posterized, with the plugin or with the float64 reference.

#[cfg(feature = "bevy")]
mod gpu;
mod interface;
mod reference;

pub use interface::{Adapter, FrameTimes, Look, PosterizeSettings, Render, Scene, toon};

use clap::ValueEnum;
use plenoctree::camera::PinholeCamera;

use crate::result::Result;

/// A renderer of the images.
#[derive(Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub enum Renderer {
    /// The plugin, on the adapter that wgpu finds.
    #[cfg(feature = "bevy")]
    #[default]
    Gpu,
    /// The float64 reference, on the CPU.
    #[cfg_attr(not(feature = "bevy"), default)]
    Reference,
}

impl Renderer {
    /// Starts the renderer. `cameras` are those to render later.
    pub fn start(self, scene: Scene, cameras: &[PinholeCamera]) -> Result<Box<dyn Render>> {
        match self {
            #[cfg(feature = "bevy")]
            Self::Gpu => Ok(Box::new(gpu::GpuRenderer::new(scene, cameras)?)),
            Self::Reference => {
                let _ = cameras;
                Ok(Box::new(reference::ReferenceRenderer::new(scene)))
            }
        }
    }
}
