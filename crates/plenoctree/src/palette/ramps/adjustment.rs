//! How a ramp is shown: its color, brightness, contrast and saturation.

#[cfg(feature = "bevy")]
use bevy_reflect::std_traits::ReflectDefault;
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

use super::motion::{Motion, Shades};
use crate::palette::{colors::Palette, oklab::oklab, ramp::InvalidRamps};

/// How a ramp is shown, starting from its source colors: section 4 of the method, step 7. The default changes nothing,
/// and replaces values that are not finite.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[cfg_attr(
    feature = "bevy",
    derive(bevy_reflect::Reflect),
    reflect(Default, Clone, Debug, PartialEq),
    type_path = "plenoctree"
)]
pub struct RampAdjustment {
    /// The color that the ramp's mean becomes, in encoded sRGB, or `None` for its own, which is the default. Light and
    /// dark stay as far apart, as long as they fit between black and white.
    pub color: Option<[f64; 3]>,
    /// Added to the lightness in Oklab, which is 0 for black and 1 for white. 0 by default.
    pub brightness: f64,
    /// Factor of the differences of lightness from the mean. 1 by default, 0 for a flat ramp. Negative values count as
    /// 0.
    pub contrast: f64,
    /// Factor of the chroma. 1 by default, 0 for grays. Negative values count as 0.
    pub saturation: f64,
}

impl Default for RampAdjustment {
    fn default() -> Self {
        Self { color: None, brightness: 0.0, contrast: 1.0, saturation: 1.0 }
    }
}

impl RampAdjustment {
    /// Returns the adjustment that moves a ramp to a color in encoded sRGB, and changes nothing else.
    pub fn to_color(color: [f64; 3]) -> Self {
        Self { color: Some(color), ..Self::default() }
    }

    /// Returns the adjustment without what is not finite.
    fn finite(self) -> Self {
        let or = |value: f64, default: f64| if value.is_finite() { value } else { default };
        let Self { color, brightness, contrast, saturation } = self;
        let default = Self::default();
        Self {
            color: color.filter(|color| color.iter().all(|channel| channel.is_finite())),
            brightness: or(brightness, default.brightness),
            contrast: or(contrast, default.contrast),
            saturation: or(saturation, default.saturation),
        }
    }
}

/// The share of the differences of lightness that is kept at least, however near to black or white the color is.
pub(super) const LEAST_CONTRAST: f64 = 0.75;
/// Lightness in Oklab below which a screen hardly shows differences. Ramps that become black stay above it.
const BLACK: f64 = 0.1;

impl Palette {
    /// Returns the mean color of a ramp in encoded sRGB, by the weights of its tones in Oklab, or `None` if there is no
    /// such ramp.
    pub fn ramp_color(&self, ramp: usize) -> Option<[f64; 3]> {
        let shades = Shades::of(self, ramp)?;
        Some(crate::palette::oklab::from_oklab(shades.mean()).into())
    }

    /// Calls `show` with every tone of a ramp and its color, in encoded sRGB, when the ramp is shown with an
    /// adjustment. Does not allocate.
    ///
    /// Colors stay within [0, 1], unless the adjustment's color is outside. If the ramp would reach beyond black or
    /// white, it loses up to a quarter of its contrast, and then its mean gives way. Colors that are too vivid lose
    /// chroma.
    ///
    /// ```
    /// use plenoctree::palette::{Palette, RampAdjustment};
    ///
    /// let mut palette = Palette::new(vec![[0.5, 0.1, 0.1], [0.8, 0.2, 0.2], [0.9, 0.9, 0.9]])?;
    /// palette.ramps = palette.guess_ramps();
    /// let red = palette.ramp("red").unwrap();
    /// let mut shown = palette.colors.clone();
    /// palette.show_ramp(red, &RampAdjustment::to_color([0.1, 0.2, 0.8]), |tone, color| shown[tone] = color)?;
    /// // Both reds are blue, and one is darker than the other.
    /// assert!(shown[..2].iter().all(|[r, g, b]| b > r && b > g) && shown[0][2] < shown[1][2]);
    /// assert_eq!(shown[2], [0.9, 0.9, 0.9]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// Returns an error if there is no such ramp.
    pub fn show_ramp(
        &self,
        ramp: usize,
        adjustment: &RampAdjustment,
        mut show: impl FnMut(usize, [f64; 3]),
    ) -> Result<(), InvalidRamps> {
        let missing = InvalidRamps::Ramp { found: ramp, expected: self.ramps.len() };
        let shades = Shades::of(self, ramp).ok_or(missing)?;
        let adjustment = &adjustment.finite();
        if *adjustment == RampAdjustment::default() {
            // The source colors, bit for bit.
            shades.tones().for_each(|tone| show(tone, self.colors[tone]));
            return Ok(());
        }
        let (motion, limited) = motion(&shades, adjustment);
        shades.place(&motion, |tone, oklab| show(tone, super::gamut::shown(oklab, limited)));
        Ok(())
    }
}

/// Returns how the ramp moves, and whether its colors are limited to [0, 1].
fn motion(shades: &Shades, adjustment: &RampAdjustment) -> (Motion, bool) {
    let mut mean = adjustment.color.map_or_else(|| shades.mean(), |color| oklab(color.into()));
    let limited = adjustment.color.is_none_or(|color| color.iter().all(|channel| (0.0..=1.0).contains(channel)));
    mean.x += adjustment.brightness;
    let saturation = adjustment.saturation.max(0.0);
    mean *= DVec3::new(1.0, saturation, saturation);
    let mut contrast = adjustment.contrast.max(0.0);
    if limited {
        let (below, above) = shades.reach();
        mean.x = mean.x.clamp(0.0, 1.0);
        // Ramps of a single tone may become black, and those that are as dark already may stay.
        let black = if contrast * below > 0.0 { BLACK.min(shades.mean().x - below) } else { 0.0 };
        contrast = contrast.min(room(mean.x - black, below, 1.0 - mean.x, above).max(LEAST_CONTRAST * contrast));
        // A ramp that is still too long is cut off at the light end.
        mean.x = mean.x.min(1.0 - contrast * above).max(black + contrast * below).min(1.0);
    }
    (Motion { mean, contrast, spread: saturation.min(1.0), tint: DVec2::ZERO }, limited)
}

/// Returns the largest contrast with which a ramp that reaches this far below and above its mean lightness fits into
/// the space that is there.
pub(super) fn room(space_below: f64, below: f64, space_above: f64, above: f64) -> f64 {
    let fits = |space: f64, reach: f64| if reach > 0.0 { space / reach } else { f64::INFINITY };
    fits(space_below, below).min(fits(space_above, above)).max(0.0)
}
