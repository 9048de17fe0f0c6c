//! What renderers have in common: what they are given, and what they give.

use image::RgbImage;
use plenoctree::{PlenOctree, camera::PinholeCamera, palette::Palette};

use crate::{Result, preset::Preset};

/// The posterized look, whichever renderer makes it.
#[derive(Clone, Copy)]
pub struct Look {
    /// Steps from one palette color to another.
    pub blend_steps: u32,
    /// Distance in encoded RGB over which labels blend.
    pub softness: f32,
    /// Opacity under which a pixel is shown as rendered.
    pub min_opacity: f32,
}

/// What to draw.
pub struct Job {
    /// The field.
    pub field: PlenOctree,
    /// The field's palette.
    pub palette: Palette,
    /// The palette to recolor with.
    pub recolored: Option<Vec<[f64; 3]>>,
    /// The posterized look.
    pub look: Look,
    /// For the GPU; the reference is always exact.
    #[cfg_attr(not(feature = "bevy"), allow(dead_code))]
    pub quality: Preset,
    /// Encoded sRGB.
    pub background: [u8; 3],
}

/// The images of one view.
pub struct Views {
    /// As rendered.
    pub original: RgbImage,
    /// Posterized with the field's palette.
    pub posterized: RgbImage,
    /// Posterized and shown in other colors.
    pub recolored: Option<RgbImage>,
}

/// Milliseconds that a posterized view took; `None` where it could not be measured.
#[derive(Clone, Copy, Default)]
pub struct FrameTimes {
    /// The volume pass.
    pub volume: Option<f64>,
    /// The posterize passes.
    pub posterize: Option<f64>,
    /// The whole frame, until its image was in memory.
    pub total: Option<f64>,
}

/// What rendered, for the report.
pub struct Adapter {
    /// The adapter's name.
    pub name: String,
    /// Its graphics API.
    pub backend: String,
    /// Its driver and the driver's version.
    pub driver: String,
}

/// Makes the images of views.
pub trait Render {
    /// Renders the view of one camera.
    fn render(&mut self, camera: &PinholeCamera) -> Result<(Views, FrameTimes)>;

    /// What renders.
    fn adapter(&self) -> Adapter;
}
