//! The stylized look of props and views: section 4 of the method.

use bevy::prelude::*;

/// The most steps from one palette color to another.
pub const MAX_BLEND_STEPS: u32 = 8;
/// The most iterations that the bilateral filter can do.
pub const MAX_FILTER_ITERATIONS: u32 = 16;
/// The largest radius of the bilateral filter, in pixels.
pub const MAX_FILTER_RADIUS: u32 = 6;

/// The stylized look of a [`Prop`](crate::Prop): section 4 of the method.
///
/// Needs a palette in [`Palettes`](crate::Palettes), which is read or extracted when none is there; until it is ready the
/// prop is shown as trained. [`PaletteOverride`](crate::PaletteOverride) gives the entity colors of its own. On a camera
/// it is the look of a [`PosterizeView`](crate::PosterizeView).
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
#[type_path = "bevy_plenoctree"]
pub struct Posterize {
    /// `d`: steps from one palette color to another; 1 makes labels of the palette colors alone. 1 to
    /// [`MAX_BLEND_STEPS`]; 3 by default.
    pub blend_steps: u32,
    /// `D`: distance in encoded RGB over which neighboring labels blend; 0 is a hard edge. 0 to 0.4 is useful; 0.2 by
    /// default.
    pub softness: f32,
    /// `lambda`: pixels whose opacity is lower are shown as trained. 0 to 1; 80/255 by default.
    pub min_opacity: f32,
    /// The filter that flattens colors before labels are assigned.
    pub filter: BilateralFilter,
}

impl Default for Posterize {
    fn default() -> Self {
        Self { blend_steps: 3, softness: 0.2, min_opacity: 80.0 / 255.0, filter: BilateralFilter::default() }
    }
}

/// A separable bilateral filter: section 4, step 2 of the method.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Default, Clone, Debug, PartialEq)]
#[type_path = "bevy_plenoctree"]
pub struct BilateralFilter {
    /// How often it runs, horizontally and vertically each time. 0 (no filter) to [`MAX_FILTER_ITERATIONS`]; 4 by default.
    pub iterations: u32,
    /// Radius in pixels. 0 to [`MAX_FILTER_RADIUS`]; 2 by default.
    pub radius: u32,
    /// Spatial sigma in pixels. Positive; 3 by default.
    pub spatial_sigma: f32,
    /// Range sigma in CIELAB. Positive; 4.25 by default.
    pub range_sigma: f32,
}

impl Default for BilateralFilter {
    fn default() -> Self {
        Self { iterations: 4, radius: 2, spatial_sigma: 3.0, range_sigma: 4.25 }
    }
}
