//! The spaces in which colors are compared to labels.

use glam::DVec3;

use super::{colors::Palette, method::PaletteMethod, oklab::oklab};

/// The space in which pixels are compared to the labels of a palette: section 4 of the method, step 3.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum LabelSpace {
    /// Encoded sRGB, as in the paper. The default.
    #[default]
    Encoded,
    /// [`tone_space`], in which tones are found, too.
    Tones,
}

impl LabelSpace {
    /// Returns where a color in encoded sRGB is in this space.
    pub fn place(self, encoded: DVec3) -> DVec3 {
        match self {
            Self::Encoded => encoded,
            Self::Tones => tone_space(encoded),
        }
    }
}

impl Palette {
    /// Returns the space in which pixels are compared to the palette's labels: [`LabelSpace::Tones`] if the palette was
    /// extracted by [`PaletteMethod::Tones`], and otherwise [`LabelSpace::Encoded`], whether it has ramps or not.
    pub fn label_space(&self) -> LabelSpace {
        if self.method == Some(PaletteMethod::Tones) { LabelSpace::Tones } else { LabelSpace::Encoded }
    }
}

/// How much more a difference of chroma counts than one of lightness.
const CHROMA: f64 = 2.0;

/// Returns where a color in encoded sRGB is in tone space: Oklab, but a and b count twice as much, so that tones keep
/// hues apart before they keep lights and shadows apart. Section 3 of the method, step 11.
///
/// Black is at 0 and white at (1, 0, 0). Channels are clamped to [0, 1], as in the histograms that tones are fitted to:
/// radiance that is brighter than a display can show gets the tone of what the display shows.
pub fn tone_space(encoded: DVec3) -> DVec3 {
    from_oklab(oklab(encoded.clamp(DVec3::ZERO, DVec3::ONE)))
}

/// Returns the index of the nearest of some places, and the square of its distance. Ties go to the first place. Without
/// places, the distance is infinite.
pub(super) fn nearest(place: DVec3, places: impl IntoIterator<Item = DVec3>) -> (usize, f64) {
    let mut best = (0, f64::INFINITY);
    for (index, other) in places.into_iter().enumerate() {
        let distance = place.distance_squared(other);
        if distance < best.1 {
            best = (index, distance);
        }
    }
    best
}

/// Returns where a color of Oklab is in [`tone_space`].
pub(super) fn from_oklab(oklab: DVec3) -> DVec3 {
    oklab * DVec3::new(1.0, CHROMA, CHROMA)
}

#[cfg(test)]
mod tests {
    use glam::swizzles::Vec3Swizzles;

    use super::*;
    use crate::palette::PaletteLabel;

    /// Grays are as far apart as their lightness, and a tint is farther from gray than a shade that differs as much.
    #[test]
    fn chroma_counts_more_than_lightness() {
        let [black, gray, white] = [0.0, 0.5, 1.0].map(|level| tone_space(DVec3::splat(level)));
        assert!(black.length() < 1e-9 && white.distance(DVec3::X) < 1e-6 && gray.yz().length() < 1e-6);
        let off = |by: DVec3| from_oklab(DVec3::new(gray.x, 0.0, 0.0) + by).distance(gray);
        assert!((off(0.02 * DVec3::Y) - 2.0 * off(0.02 * DVec3::X)).abs() < 1e-6);
    }

    /// Brighter than white is white: not what its hue would be without limits.
    #[test]
    fn colors_are_those_of_displays() {
        let tones = Palette::new(vec![[1.0, 1.0, 0.3], [1.0, 0.6, 0.1]]).unwrap();
        let tones = Palette { method: Some(PaletteMethod::Tones), ..tones };
        let bright = DVec3::new(2.6, 1.7, 0.3);
        assert_eq!(PaletteLabel::nearest(bright, &tones, 1).map(|label| label.index), Some(0));
        assert_eq!(tone_space(bright), tone_space(DVec3::new(1.0, 1.0, 0.3)));
    }

    /// A shaded red is a shade of red, although a gray is nearer in encoded sRGB. Palettes without a method are
    /// compared as in the paper.
    #[test]
    fn the_method_of_a_palette_decides() {
        let (red, shaded, gray) = ([0.85, 0.2, 0.2], DVec3::new(0.49, 0.1, 0.1), [0.25; 3]);
        let mut palette = Palette::new(vec![red, gray]).unwrap();
        let nearest = |palette: &Palette| PaletteLabel::nearest(shaded, palette, 1).map(|label| label.index);
        assert_eq!((palette.label_space(), nearest(&palette)), (LabelSpace::Encoded, Some(1)));
        palette.method = Some(PaletteMethod::Tones);
        assert_eq!((palette.label_space(), nearest(&palette)), (LabelSpace::Tones, Some(0)));
        palette.method = Some(PaletteMethod::Fitted);
        assert_eq!((palette.label_space(), nearest(&palette)), (LabelSpace::Encoded, Some(1)));
    }
}
