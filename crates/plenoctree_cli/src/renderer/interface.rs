//! The interface of renderers.

use image::{RgbImage, RgbaImage};
use plenoctree::{PlenOctree, camera::PinholeCamera, palette::Palette, reference::Posterization};

use crate::{preset::Preset, result::Result};

/// The scene to render.
pub struct Scene {
    /// The field.
    pub field: PlenOctree,
    /// The quality preset for the GPU. The reference is always exact.
    #[cfg_attr(not(feature = "bevy"), allow(dead_code))]
    pub quality: Preset,
    /// The background color, in encoded sRGB.
    pub background: [u8; 3],
}

/// How to posterize. All colors are encoded sRGB.
#[derive(Clone, Copy)]
pub struct Look<'a> {
    /// The palette, whose colors decide which pixels get which label.
    pub palette: &'a Palette,
    /// The colors that appear in their place, as many as the palette has.
    pub shown: &'a [[f64; 3]],
    /// The settings of posterization.
    pub settings: PosterizeSettings,
}

/// Settings of posterization, for every renderer. By default, those of the paper.
#[derive(Clone, Copy, Default)]
pub struct PosterizeSettings {
    /// The settings of the reference. Their `space` is ignored: it is always that of the palette's labels.
    pub posterization: Posterization,
    /// Whether the edges of the prop and the borders between hard labels are smooth. GPU only.
    #[cfg_attr(not(feature = "bevy"), allow(dead_code))]
    pub smooth_edges: bool,
    /// Whether lines are drawn. GPU only.
    #[cfg_attr(not(feature = "bevy"), allow(dead_code))]
    pub ink: bool,
}

/// Returns the settings of the plugin's default, for tones: hard labels, and a filter of its own.
pub fn toon() -> Posterization {
    let (spatial_sigma, range_sigma) = (5.0, 5.0);
    Posterization { softness: 0.0, iterations: 1, radius: 6, taps: 4, spatial_sigma, range_sigma, ..Default::default() }
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
