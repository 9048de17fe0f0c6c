//! Recoloring without labels: colors belong to ramps by degrees. Section 4 of the method, step 9.

use glam::DVec3;

use crate::palette::{
    colors::Palette,
    oklab::{from_oklab, oklab},
    space::tone_space,
};

/// The distance in tone space over which membership passes from one tone to another that is as near.
const REACH: f64 = 0.08;

/// Calls `add` with every palette color that a color in encoded sRGB belongs to, and its share. Shares sum to 1.
pub(super) fn shares(palette: &Palette, color: [f64; 3], mut add: impl FnMut(usize, f64)) {
    let place = tone_space(color.into());
    let square = |tone: &[f64; 3]| place.distance_squared(tone_space((*tone).into()));
    let nearest = palette.colors.iter().map(square).fold(f64::INFINITY, f64::min);
    // No tone counts that is much farther than the nearest, so that most edits leave most colors alone, to the bit.
    let share = |tone: &[f64; 3]| (1.0 - (square(tone) - nearest) / (REACH * REACH)).max(0.0).powi(2);
    let total: f64 = palette.colors.iter().map(share).sum();
    for (index, share) in palette.colors.iter().map(share).enumerate() {
        if share > 0.0 {
            add(index, share / total);
        }
    }
}

impl Palette {
    /// Returns a color as trained after the palette's colors have changed to `shown`, all in encoded sRGB: it moves in
    /// Oklab as the palette colors do that it belongs to, so that textures stay. Its channels may be outside [0, 1].
    ///
    /// A color whose palette colors do not change is returned as it is, bit for bit. Palette colors beyond the end of
    /// `shown` do not change.
    ///
    /// ```
    /// use plenoctree::palette::{Palette, RampAdjustment};
    ///
    /// let mut palette = Palette::new(vec![[0.5, 0.1, 0.1], [0.8, 0.2, 0.2], [0.9, 0.9, 0.9]])?;
    /// palette.ramps = palette.guess_ramps();
    /// let red = palette.ramp("red").unwrap();
    /// let mut shown = palette.colors.clone();
    /// palette.show_ramp(red, &RampAdjustment::to_color([0.1, 0.2, 0.8]), |tone, color| shown[tone] = color)?;
    /// let [r, _, b] = palette.recolored_as_trained([0.6, 0.14, 0.15], &shown);
    /// assert!(b > r);
    /// assert_eq!(palette.recolored_as_trained([0.8, 0.8, 0.8], &shown), [0.8, 0.8, 0.8]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn recolored_as_trained(&self, color: [f64; 3], shown: &[[f64; 3]]) -> [f64; 3] {
        let mut moved = DVec3::ZERO;
        shares(self, color, |tone, share| {
            let source = self.colors[tone];
            if let Some(shown) = shown.get(tone).filter(|shown| **shown != source) {
                moved += share * (oklab((*shown).into()) - oklab(source.into()));
            }
        });
        if moved == DVec3::ZERO { color } else { from_oklab(oklab(color.into()) + moved).into() }
    }
}
