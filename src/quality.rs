//! Settings that trade a camera's accuracy for speed.

use bevy::prelude::*;

use crate::posterize::MAX_FILTER_ITERATIONS;

/// Trades accuracy for speed when a camera draws props.
///
/// Add it to an entity with a `Camera3d`. Cameras without it use the default: [`PropQuality::EXACT`], with
/// steady labels and estimated edges.
///
/// With the feature `shadows`, it can also be added to a light. The settings that select a level then apply to the
/// props in its shadow maps, and [`cell_size`](Self::cell_size) is in texels. Lights without it use a `cell_size` of 1.
///
/// Each setting works on its own: `PropQuality { cell_size: 1.0, ..PropQuality::EXACT }`. To measure what each one
/// costs and saves on your own field, run `cargo run --release -p lab -- tradeoff` in the repository.
///
/// Three settings select a *level*, a version of the field that is cheaper to draw: [`density_threshold`],
/// [`opacity_loss`] and [`cell_size`]. A level is made in the background when a camera or a light first requests it;
/// until it is ready, the field itself or a more exact level is drawn. Levels take additional GPU memory until no
/// camera or light has requested them for 600 frames, so do not animate these settings.
///
/// The table lists the accuracy that tests guarantee for the presets: the lowest PSNR against float64, and the largest
/// fraction of the prop's pixels with another label than in float64, when labels do not blend. The tests draw the most
/// demanding of the baked props (thin rails, gloss) and a field that no preset was tuned to. They fill a frame of 400 x
/// 400 pixels or, in parentheses, of 160 x 160 pixels, in which their details are the size of pixels. Larger frames are
/// more accurate. Fields with many details of the size of pixels are less accurate: of a trained field of 256 cells per
/// side, [`BALANCED`](Self::BALANCED) changes twice as many labels.
///
/// | | PSNR, at least | labels changed, at most |
/// |---|---|---|
/// | [`EXACT`](Self::EXACT) | 55 dB (55) | 1% (1) |
/// | [`HIGH`](Self::HIGH) | 45 dB (45) | 2% (2) |
/// | [`BALANCED`](Self::BALANCED) | 38 dB (34) | 8% (10) |
/// | [`FAST`](Self::FAST) | 33 dB (29) | 20% (23) |
///
/// [`density_threshold`]: Self::density_threshold
/// [`opacity_loss`]: Self::opacity_loss
/// [`cell_size`]: Self::cell_size
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
#[type_path = "bevy_plenoctree"]
pub struct PropQuality {
    /// The transmittance below which a ray stops and its pixel counts as opaque.
    ///
    /// Defaults to 0.01, the value of the method. Clamped to 0..=1.
    pub stop_transmittance: f32,
    /// The density below which leaves are left out, per unit of the field, whatever the prop's scale. Applies in
    /// addition to the [threshold for loading](plenoctree::LoadSettings::density_threshold).
    ///
    /// Defaults to 0. Negative values count as 0.
    pub density_threshold: f32,
    /// The opacity that rays may lose when faint leaves are dropped, the faintest first: the root mean square over rays
    /// along the field's axes. Fog consists of faint leaves only, and is kept.
    ///
    /// Defaults to 0, which keeps all leaves; 0.002 is barely visible. Clamped to 0..=1.
    pub opacity_loss: f32,
    /// The largest size, in pixels, that the cells of a level of detail may have where the prop is nearest to the
    /// camera. Smaller cells are averaged.
    ///
    /// Defaults to 0, which always draws the finest cells; 1 is barely visible. Negative values count as 0.
    pub cell_size: f32,
    /// The largest difference between neighboring rays at which the pixels between them are interpolated: of a channel
    /// of encoded sRGB, of opacity, or of distance, relative to the distance itself.
    ///
    /// Above 0, only a grid of rays is cast at first, through every second pixel along each axis. Where these differ by
    /// more, or belong to different props, or where a mesh ends in front of a prop, all pixels get rays. What is
    /// thinner than two pixels may be missed where no ray of the grid meets it.
    ///
    /// Defaults to 0, which gives every pixel a ray. Below 0.1, hardly any time is saved. Where props are so
    /// small that nearly all of their pixels get rays anyway, it costs time. Negative values count as 0.
    pub ray_tolerance: f32,
    /// The number of rays through a pixel where a posterized prop ends, for
    /// [`EdgeSmoothing::Coverage`](crate::EdgeSmoothing::Coverage): 4 or 8. Views with [`Msaa`] always cast 8. Both
    /// leave about a quarter of the error of hard edges, but four rays miss more details that are thinner than a pixel.
    ///
    /// Defaults to 8. Values below 8 count as 4, and larger ones as 8.
    pub edge_rays: u32,
    /// Whether to estimate how much of an edge pixel a prop covers from the opacity around it, where that suffices,
    /// instead of casting rays. It suffices where cells are larger than two or three pixels, and no other prop is near:
    /// opacity then changes gradually across edges. The error that remains grows by about 0.03 of that of hard edges.
    ///
    /// Defaults to true, unlike [`EXACT`](Self::EXACT).
    pub estimates_edges: bool,
    /// The upper limit of [`BilateralFilter::iterations`](crate::BilateralFilter::iterations), for everything that the
    /// camera posterizes.
    ///
    /// Defaults to [`MAX_FILTER_ITERATIONS`], which is no limit.
    pub filter_iterations: u32,
    /// Whether pixels may keep their labels while something moves: see
    /// [`Posterize::steadiness`](crate::Posterize::steadiness).
    ///
    /// Defaults to true, unlike [`EXACT`](Self::EXACT).
    pub steady_labels: bool,
}

impl Default for PropQuality {
    /// Returns [`PropQuality::EXACT`], with steady labels and estimated edges.
    fn default() -> Self {
        Self { estimates_edges: true, steady_labels: true, ..Self::EXACT }
    }
}

impl PropQuality {
    /// Draws props exactly, and every frame by itself.
    pub const EXACT: Self = Self {
        stop_transmittance: 0.01,
        density_threshold: 0.0,
        opacity_loss: 0.0,
        cell_size: 0.0,
        ray_tolerance: 0.0,
        edge_rays: 8,
        estimates_edges: false,
        filter_iterations: MAX_FILTER_ITERATIONS,
        steady_labels: false,
    };
    /// Hardly distinguishable from [`EXACT`](Self::EXACT).
    pub const HIGH: Self = Self {
        stop_transmittance: 0.03,
        opacity_loss: 0.01,
        cell_size: 0.5,
        edge_rays: 4,
        estimates_edges: true,
        steady_labels: true,
        ..Self::EXACT
    };
    /// A compromise for most games.
    pub const BALANCED: Self =
        Self { opacity_loss: 0.02, cell_size: 1.0, ray_tolerance: 0.18, filter_iterations: 3, ..Self::HIGH };
    /// For a slow GPU. Crowds of tiny props gain nothing: see [`ray_tolerance`](Self::ray_tolerance).
    pub const FAST: Self = Self {
        stop_transmittance: 0.05,
        opacity_loss: 0.05,
        cell_size: 1.5,
        ray_tolerance: 0.4,
        filter_iterations: 1,
        ..Self::HIGH
    };
    /// All presets and their names, from the most exact to the fastest.
    pub const PRESETS: [(&'static str, Self); 4] =
        [("exact", Self::EXACT), ("high", Self::HIGH), ("balanced", Self::BALANCED), ("fast", Self::FAST)];

    /// Clamps every field to its valid range, so that no shader divides by zero or loops for too long. NaN becomes the
    /// value of [`EXACT`](Self::EXACT).
    pub(crate) fn clamped(self) -> Self {
        let clamp = |value: f32, low: f32, high: f32, exact: f32| {
            if value.is_nan() { exact } else { value.clamp(low, high) }
        };
        let exact = Self::EXACT;
        Self {
            // Rays go on until there is something.
            stop_transmittance: clamp(self.stop_transmittance, 1e-30, 1.0 - f32::EPSILON, exact.stop_transmittance),
            density_threshold: clamp(self.density_threshold, 0.0, f32::INFINITY, exact.density_threshold),
            opacity_loss: clamp(self.opacity_loss, 0.0, 1.0, exact.opacity_loss),
            cell_size: clamp(self.cell_size, 0.0, f32::INFINITY, exact.cell_size),
            ray_tolerance: clamp(self.ray_tolerance, 0.0, f32::INFINITY, exact.ray_tolerance),
            edge_rays: if self.edge_rays < 8 { 4 } else { 8 },
            ..self
        }
    }
}
