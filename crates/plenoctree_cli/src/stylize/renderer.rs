//! The interface of renderers: their input and their output.

use image::RgbImage;
use plenoctree::{PlenOctree, camera::PinholeCamera, palette::Palette};

use crate::{Result, preset::Preset};

/// Settings of posterization, for every renderer.
#[derive(Clone, Copy)]
pub struct PosterizeSettings {
    /// The number of steps from one palette color to another.
    pub blend_steps: u32,
    /// The distance over which labels blend, in encoded sRGB.
    pub softness: f32,
    /// The opacity below which pixels are drawn as trained.
    pub min_opacity: f32,
}

/// What to draw.
pub struct Job {
    /// The field.
    pub field: PlenOctree,
    /// The field's palette.
    pub palette: Palette,
    /// The shown colors of the recolored images.
    pub recolored: Option<Vec<[f64; 3]>>,
    /// The settings of posterization.
    pub posterize: PosterizeSettings,
    /// The quality preset for the GPU. The reference is always exact.
    #[cfg_attr(not(feature = "bevy"), allow(dead_code))]
    pub quality: Preset,
    /// The background color, in encoded sRGB.
    pub background: [u8; 3],
}

/// The images of one view.
pub struct Views {
    /// As trained.
    pub original: RgbImage,
    /// Posterized with the field's palette.
    pub posterized: RgbImage,
    /// Posterized and recolored.
    pub recolored: Option<RgbImage>,
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

/// The adapter that rendered, for the report.
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
    /// Renders the view of one camera.
    fn render(&mut self, camera: &PinholeCamera) -> Result<(Views, FrameTimes)>;

    /// Returns the adapter that renders.
    fn adapter(&self) -> Adapter;
}
