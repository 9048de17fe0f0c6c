//! Settings of packing.

#[cfg(feature = "bevy")]
use bevy_reflect::std_traits::ReflectDefault;
use serde::{Deserialize, Serialize};

use crate::{
    field::{Activation, Basis, PlenOctree},
    file::{MAX_LEVELS, MAX_ROWS},
    sampling::InvalidSetting,
};

/// Settings of packing: how small a field becomes, and how much its pictures may change.
///
/// [`Self::SMALL`], [`Self::BALANCED`] (the default) and [`Self::FINE`] suit most fields. The table in
/// `docs/packing.md` shows their results.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[cfg_attr(
    feature = "bevy",
    derive(bevy_reflect::Reflect),
    reflect(Default, Clone, Debug, PartialEq),
    type_path = "plenoctree"
)]
pub struct PackSettings {
    /// Opacity, 0 to 1, that a leaf must add to a ray from outside to be kept. While the leaves that are dropped would
    /// add more than 0.05 to rays side by side, as in a fog, a quarter of it is used instead. 0 keeps all leaves, and
    /// the colors of those that are hidden from outside, for fields that are also seen from inside.
    pub hidden: f32,
    /// Weight of views from below the horizon, relative to others. 0 to 1.
    pub below: f32,
    /// Largest number of rows of the codebook of luma, which leaves share. That of color differences has half as many.
    /// 1 to 65,536.
    pub rows: u32,
    /// Largest number of densities. 2 to 254.
    pub density_levels: u32,
    /// Step of leaves' colors, in encoded sRGB. 0.0001 to 1. Luma has 4096 steps, and differences of channels have
    /// 1024. Where colors need more room, a smaller step than 0.008 is raised, up to that. Colors out of reach are
    /// clipped.
    pub color_step: f32,
    /// Step of the codebooks' coefficients, in the same unit. 0.0001 to 1. Coefficients have 255 steps. Where they need
    /// more room, a smaller step than 0.01 is raised, up to that.
    pub table_step: f32,
    /// Step, in the same unit, to which the colors of a leaf of average visibility are rounded. Those of less visible
    /// leaves are rounded more, and all at least to `color_step`. 0 to 1.
    pub tolerance: f32,
    /// Whether the file records the [histograms](PlenOctree::histograms) of the field. Fitted palettes and those of
    /// hulls that are extracted from the packed field then equal those of the field, and nothing is sampled when a game
    /// extracts them. Tones, which are fitted to views of the packed field, are nearly the same. False by default:
    /// palettes are extracted from what is drawn, unless the field already records histograms, as it keeps them.
    pub record_histograms: bool,
}

impl PackSettings {
    /// For fields that are seen from afar.
    pub const SMALL: Self = Self {
        hidden: 0.01,
        below: 0.1,
        rows: 16384,
        density_levels: 48,
        color_step: 0.03,
        table_step: 0.03,
        tolerance: 0.1,
        record_histograms: false,
    };
    /// For most fields.
    pub const BALANCED: Self = Self {
        hidden: 0.004,
        below: 0.1,
        rows: 32768,
        density_levels: 96,
        color_step: 0.015,
        table_step: 0.02,
        tolerance: 0.04,
        record_histograms: false,
    };
    /// For fields that are seen from close by.
    pub const FINE: Self = Self {
        hidden: 0.001,
        below: 0.3,
        rows: 65536,
        density_levels: 192,
        color_step: 0.008,
        table_step: 0.01,
        tolerance: 0.03,
        record_histograms: false,
    };

    /// Checks that every setting is in its range.
    ///
    /// # Errors
    ///
    /// Returns an error that names the first setting that is out of range.
    pub fn validate(&self) -> Result<(), InvalidSetting> {
        let share =
            |setting, found: f32| InvalidSetting::check((0.0..=1.0).contains(&found), setting, found.into(), "0 to 1");
        share("hidden", self.hidden)?;
        share("below", self.below)?;
        let count = |setting, found: u32, least: u32, most: usize, expected| {
            let holds = (least as usize..=most).contains(&(found as usize));
            InvalidSetting::check(holds, setting, found.into(), expected)
        };
        count("rows", self.rows, 1, MAX_ROWS, "1 to 65536")?;
        count("density_levels", self.density_levels, 2, MAX_LEVELS, "2 to 254")?;
        let step = |setting, found: f32| {
            let holds = (1e-4..=1.0).contains(&found);
            InvalidSetting::check(holds, setting, found.into(), "0.0001 to 1")
        };
        step("color_step", self.color_step)?;
        step("table_step", self.table_step)?;
        share("tolerance", self.tolerance)
    }

    /// Returns the coefficient that makes a difference of 1 in encoded sRGB where the activation is steepest.
    pub(super) fn unit(&self, field: &PlenOctree) -> f32 {
        let constant = if field.basis() == Basis::Rgba { 1.0 } else { Basis::FACTORS[0] as f32 };
        1.0 / (self.slope(field) * constant)
    }

    /// Returns the slope of the activation where it is steepest.
    pub(super) fn slope(&self, field: &PlenOctree) -> f32 {
        if field.activation() == Activation::Sigmoid { 0.25 } else { 1.0 }
    }

    /// Returns how many bits an error of the color of a channel of average visibility is worth, in encoded sRGB.
    ///
    /// The error of the best step is a twelfth of its square, and another bit leaves a quarter of it. Its derivative is
    /// `2 ln 2 / 12` of the square.
    pub(super) fn bits(&self, error: f32) -> f32 {
        (error / self.tolerance.max(1e-6)).powi(2) / 0.1155
    }
}

impl Default for PackSettings {
    fn default() -> Self {
        Self::BALANCED
    }
}
