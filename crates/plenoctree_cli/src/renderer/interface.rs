//! The interface of renderers.

use image::{RgbImage, RgbaImage};
use plenoctree::{LABEL_OPACITY, PlenOctree, camera::PinholeCamera, palette::Palette};

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

/// Settings of posterization, for every renderer.
#[derive(Clone, Copy)]
pub struct PosterizeSettings {
    /// The number of steps from one palette color to another.
    pub blend_steps: u32,
    /// The distance over which labels blend, in the space of the palette's labels.
    pub softness: f32,
    /// The opacity below which pixels are drawn as trained.
    pub min_opacity: f32,
    /// The filter that flattens colors.
    pub filter: Filter,
    /// Whether the edges of the prop and the borders between hard labels are smooth. GPU only.
    #[cfg_attr(not(feature = "bevy"), allow(dead_code))]
    pub smooth_edges: bool,
    /// Whether lines are drawn. GPU only.
    #[cfg_attr(not(feature = "bevy"), allow(dead_code))]
    pub ink: bool,
}

impl Default for PosterizeSettings {
    /// Returns the settings of the paper.
    fn default() -> Self {
        Self {
            blend_steps: 3,
            softness: 0.2,
            min_opacity: LABEL_OPACITY as f32,
            filter: Filter::PAPER,
            smooth_edges: false,
            ink: false,
        }
    }
}

/// The settings of the bilateral filter, for every renderer: the iterations, the radius in pixels, how many pixels it
/// reads on each side, and the sigmas in pixels and in CIELAB.
#[derive(Clone, Copy)]
pub struct Filter {
    pub iterations: u32,
    pub radius: u32,
    pub taps: u32,
    pub spatial_sigma: f32,
    pub range_sigma: f32,
}

impl Filter {
    /// That of the paper.
    pub const PAPER: Self = Self { iterations: 4, radius: 2, taps: 6, spatial_sigma: 3.0, range_sigma: 4.25 };
    /// That of the plugin's default, for tones.
    pub const TONES: Self = Self { iterations: 1, radius: 6, taps: 4, spatial_sigma: 5.0, range_sigma: 5.0 };
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
