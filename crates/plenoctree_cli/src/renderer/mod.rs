//! Renders views of a field as trained and posterized, with the plugin or with the float64 reference.

#[cfg(feature = "bevy")]
mod gpu;
mod reference;

use clap::ValueEnum;
use image::{RgbImage, RgbaImage};
use plenoctree::{PlenOctree, camera::PinholeCamera};

use crate::{Result, preset::Preset};

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

/// What to draw.
pub struct Scene {
    /// The field.
    pub field: PlenOctree,
    /// The quality preset for the GPU. The reference is always exact.
    #[cfg_attr(not(feature = "bevy"), allow(dead_code))]
    pub quality: Preset,
    /// The background color, in encoded sRGB.
    pub background: [u8; 3],
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

/// How to posterize. All colors are encoded sRGB.
#[derive(Clone, Copy)]
pub struct Look<'a> {
    /// The palette's colors that decide which pixels get which label.
    pub source: &'a [[f64; 3]],
    /// The colors that appear in their place, as many as `source`.
    pub shown: &'a [[f64; 3]],
    /// The settings of posterization.
    pub settings: PosterizeSettings,
}

/// Settings of posterization, for every renderer.
#[derive(Clone, Copy)]
pub struct PosterizeSettings {
    /// The number of steps from one palette color to another.
    pub blend_steps: u32,
    /// The distance over which labels blend, in encoded sRGB.
    pub softness: f32,
    /// The opacity below which pixels are drawn as trained.
    pub min_opacity: f32,
    /// Whether pixels at which the prop ends are blended with the background. Only the GPU does so.
    #[cfg_attr(not(feature = "bevy"), allow(dead_code))]
    pub smooth_edges: bool,
}

impl Default for PosterizeSettings {
    fn default() -> Self {
        Self { blend_steps: 3, softness: 0.2, min_opacity: 80.0 / 255.0, smooth_edges: false }
    }
}

/// The times of a posterized view in milliseconds. `None` if they could not be measured.
#[derive(Clone, Copy, Default)]
pub struct FrameTimes {
    /// The volume pass.
    pub volume: Option<f64>,
    /// The posterize passes.
    pub posterize: Option<f64>,
    /// The whole frame, until it was in memory.
    pub total: Option<f64>,
}

/// The adapter that renders, for the report.
pub struct Adapter {
    /// The adapter's name.
    pub name: String,
    /// Its graphics API.
    pub backend: String,
    /// Its driver and the driver's version.
    pub driver: String,
}

/// Renders views.
pub trait Render {
    /// Renders a view as trained. Colors are over the background, and alpha is the field's opacity.
    fn original(&mut self, camera: &PinholeCamera) -> Result<RgbaImage>;

    /// Renders a view posterized, over the background.
    fn posterized(&mut self, camera: &PinholeCamera, look: &Look) -> Result<(RgbImage, FrameTimes)>;

    /// Returns the adapter that renders.
    fn adapter(&self) -> Adapter;
}
