//! How much accuracy a camera gives up for speed.

use bevy::prelude::*;

use plenoctree::{palette::ExtractionSettings, sampling::SamplingSettings};

use crate::posterize::{MAX_FILTER_ITERATIONS, MAX_FILTER_RADIUS};

/// How exactly a camera draws props. On an entity with a `Camera3d`; without it, [`PropQuality::EXACT`].
///
/// Every knob can be turned alone: `PropQuality { cell_size: 1.0, ..PropQuality::EXACT }`. What each costs and gains on a field of
/// yours is what the example `tradeoff` measures.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
#[type_path = "bevy_plenoctree"]
pub struct PropQuality {
    /// A ray ends where transmittance is less than this, and the pixel counts as opaque. 0 to 1; 0.01, the method's, by
    /// default.
    pub stop_transmittance: f32,
    /// Leaves that are less dense are left out, besides those that are dropped at loading. Per world unit of the field; 0
    /// by default.
    pub density_threshold: f32,
    /// Faint leaves are left out, the faintest first, as many as can be without rays' losing more than this of their opacity
    /// (root mean square over rays along the field's axes). 0, none, by default; 0.002 is hardly seen. Fog, all of which is
    /// faint, stays.
    ///
    /// Such a form of the field, and every level of detail, is made in the background when a camera first asks for it; the
    /// field is drawn as it is meanwhile. It has memory of its own on the GPU until no camera has asked for 600 frames: do
    /// not animate these knobs.
    pub opacity_loss: f32,
    /// A leaf that adds less than this to the opacity of a pixel is not asked for its color; the others make up for it. 0
    /// to 1; 0 by default.
    pub min_weight: f32,
    /// The highest degree of spherical harmonics that is evaluated: 0 leaves no highlights. 4, all that there are, by
    /// default.
    pub degree: u32,
    /// The level of detail: cells of a prop are averaged as long as they stay smaller than this, in pixels, where the prop
    /// is nearest to the camera. 0, never, by default; 1 is hardly seen.
    pub cell_size: f32,
    /// Pixels of the volume pass along each axis, as a share of the viewport's. They are interpolated, but not across the
    /// edges of meshes. 0.1 to 1; 1 by default.
    pub resolution: f32,
    /// Most iterations of the bilateral filter, whatever a look asks for.
    pub filter_iterations: u32,
    /// Largest radius of the bilateral filter in pixels, whatever a look asks for.
    pub filter_radius: u32,
}

impl Default for PropQuality {
    fn default() -> Self {
        Self::EXACT
    }
}

impl PropQuality {
    /// What the method asks for.
    pub const EXACT: Self = Self {
        stop_transmittance: 0.01,
        density_threshold: 0.0,
        opacity_loss: 0.0,
        min_weight: 0.0,
        degree: 4,
        cell_size: 0.0,
        resolution: 1.0,
        filter_iterations: MAX_FILTER_ITERATIONS,
        filter_radius: MAX_FILTER_RADIUS,
    };
    /// Hardly to be told from the exact picture.
    pub const HIGH: Self = Self { stop_transmittance: 0.02, opacity_loss: 0.005, cell_size: 0.5, ..Self::EXACT };
    /// For most games.
    pub const BALANCED: Self = Self {
        stop_transmittance: 0.03,
        opacity_loss: 0.04,
        cell_size: 1.0,
        resolution: 0.6,
        filter_iterations: 2,
        ..Self::EXACT
    };
    /// For many props, or little of a graphics card.
    pub const FAST: Self = Self {
        stop_transmittance: 0.05,
        opacity_loss: 0.06,
        cell_size: 1.5,
        resolution: 0.34,
        filter_iterations: 1,
        ..Self::EXACT
    };

    /// With every knob in its range, so that no shader divides by zero or loops for long.
    pub(crate) fn sound(self) -> Self {
        let within = |value: f32, low: f32, high: f32, exact: f32| {
            if value.is_nan() { exact } else { value.clamp(low, high) }
        };
        let exact = Self::EXACT;
        Self {
            stop_transmittance: within(self.stop_transmittance, 1e-30, 1.0, exact.stop_transmittance),
            density_threshold: within(self.density_threshold, 0.0, f32::INFINITY, exact.density_threshold),
            opacity_loss: within(self.opacity_loss, 0.0, 1.0, exact.opacity_loss),
            min_weight: within(self.min_weight, 0.0, 1.0, exact.min_weight),
            degree: self.degree.min(4),
            cell_size: within(self.cell_size, 0.0, f32::INFINITY, exact.cell_size),
            resolution: within(self.resolution, 0.1, 1.0, exact.resolution),
            filter_iterations: self.filter_iterations,
            filter_radius: self.filter_radius,
        }
    }
}

/// A named choice for all that trades accuracy for speed.
///
/// What it keeps, tested with the hardest of our props (thin rails, gloss) in small pictures of 160 x 160 pixels, where
/// the prop's details are as large as pixels: PSNR against float64, and the share of its pixels whose label is another than
/// float64's if labels do not blend. Larger pictures keep more; the example `tradeoff` says what a field of yours keeps.
///
/// | | PSNR at least | other labels at most |
/// |---|---|---|
/// | [`Self::Exact`] | 55 dB | 1 % |
/// | [`Self::High`] | 45 dB | 5 % |
/// | [`Self::Balanced`] | 23 dB | 60 % |
/// | [`Self::Fast`] | 20 dB | 75 % |
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
#[reflect(Default, Clone, Debug, PartialEq, Hash)]
#[type_path = "bevy_plenoctree"]
pub enum QualityPreset {
    /// What the method asks for.
    #[default]
    Exact,
    /// Hardly to be told from it.
    High,
    /// For most games.
    Balanced,
    /// For many props, or little of a graphics card.
    Fast,
}

impl QualityPreset {
    /// All of them, the most exact first.
    pub const ALL: [Self; 4] = [Self::Exact, Self::High, Self::Balanced, Self::Fast];

    /// For cameras.
    pub fn quality(self) -> PropQuality {
        match self {
            Self::Exact => PropQuality::EXACT,
            Self::High => PropQuality::HIGH,
            Self::Balanced => PropQuality::BALANCED,
            Self::Fast => PropQuality::FAST,
        }
    }

    /// For [`PaletteExtraction`](crate::PaletteExtraction): fewer samples. The colors move, a little or more: extract with
    /// the exact one what you ship.
    pub fn extraction(self) -> ExtractionSettings {
        let sample_fraction = match self {
            Self::Exact | Self::High => 1.0,
            Self::Balanced => 0.5,
            Self::Fast => 0.25,
        };
        ExtractionSettings { sampling: SamplingSettings { sample_fraction, ..default() }, ..default() }
    }
}
