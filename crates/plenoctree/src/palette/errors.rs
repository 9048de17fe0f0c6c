//! Errors of a field's colors: how far they are from the ones shown in their place.

use glam::{DVec2, DVec3};

use super::{
    colors::Palette,
    label::PaletteLabel,
    oklab::{CHROMATIC, chroma, chroma_of_linear, is_hue_off},
    space::{LabelSpace, nearest},
};
use crate::{
    sampling::{Canceled, Histograms, Progress},
    srgb::decode,
};

/// How far colors are from the ones shown in their place, such as the labels of a palette.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ColorErrors {
    /// Weighted root mean square difference of a channel, in encoded sRGB: 0 to 1. Multiply it by 255 for a number on
    /// the scale of 8-bit colors.
    pub rmse: f64,
    /// Share of the chromatic weight that is shown with a hue more than 45 degrees off, 0 to 1. Hues are those of
    /// Oklab. A color is chromatic if its chroma is above 0.04; if it is shown as an exact gray, its hue is off.
    pub hue: f64,
}

impl ColorErrors {
    /// Returns the errors of colors of some weight that are shown as other colors: `(weight, color, shown)`, both in
    /// encoded sRGB. All errors are 0 if there is no weight.
    pub fn of(shown: impl IntoIterator<Item = (f64, DVec3, DVec3)>) -> Self {
        let mut sums = Sums::default();
        for (weight, color, shown) in shown {
            sums.add(weight, color.distance_squared(shown), chroma(color), chroma(shown));
        }
        sums.errors()
    }

    /// Returns the errors of the fine histogram's colors, the centers of its bins, when they are shown as the nearest
    /// label of a palette. `blend_steps` is `d`, at least 1, or less if the palette would have more labels than
    /// [`PaletteLabel::MAX_LABELS`].
    pub fn of_labels(histograms: &Histograms, palette: &Palette, blend_steps: u32) -> Self {
        Self::of_labels_unless_canceled(histograms, palette, blend_steps, &Progress::default()).unwrap_or_default()
    }

    pub(super) fn of_labels_unless_canceled(
        histograms: &Histograms,
        palette: &Palette,
        blend_steps: u32,
        progress: &Progress,
    ) -> Result<Self, Canceled> {
        let shown = ShownColors::new(palette, blend_steps);
        let bins = &histograms.fine;
        let decoded: Vec<f64> = (0..bins.per_channel).map(|i| decode(bins.center(i)[2])).collect();
        let most = bins.weights.iter().copied().fold(0.0, f64::max);
        let mut sums = Sums::default();
        for (bin, &weight) in bins.weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
            progress.check()?;
            let color = DVec3::from(bins.center(bin));
            if let Some((label, chroma)) = shown.nearest(color) {
                // Relative weights, because the sum of the heaviest might be infinite.
                let n = bins.per_channel;
                let linear = [bin / (n * n), bin / n % n, bin % n].map(|i| decoded[i]);
                let square = color.distance_squared(label);
                sums.add(weight / most, square, chroma_of_linear(linear.into()), chroma);
            }
        }
        Ok(sums.errors())
    }
}

/// The colors that the labels of a palette show.
pub(super) struct ShownColors {
    space: LabelSpace,
    /// The place of each in the space in which labels are compared, its encoded color, and its chroma.
    labels: Vec<(DVec3, DVec3, DVec2)>,
}

impl ShownColors {
    pub fn new(palette: &Palette, blend_steps: u32) -> Self {
        let blend_steps = blend_steps.min(PaletteLabel::most_blend_steps(palette.colors.len()));
        let space = palette.label_space();
        let labels = PaletteLabel::all(palette.colors.len(), blend_steps).map(|label| label.mix(&palette.colors));
        Self { space, labels: labels.map(|label| (space.place(label), label, chroma(label))).collect() }
    }

    /// Returns the encoded color and the chroma of the label that is nearest to a color.
    pub fn nearest(&self, color: DVec3) -> Option<(DVec3, DVec2)> {
        let (index, _) = nearest(self.space.place(color), self.labels.iter().map(|label| label.0));
        self.labels.get(index).map(|&(_, label, chroma)| (label, chroma))
    }
}

#[derive(Default)]
struct Sums {
    weight: f64,
    squares: f64,
    chromatic: f64,
    off: f64,
}

impl Sums {
    /// Adds a color of some weight, given the square of its distance to the color shown, and the chroma of both.
    fn add(&mut self, weight: f64, square: f64, color: DVec2, shown: DVec2) {
        self.weight += weight;
        self.squares += weight * square;
        if color.length() > CHROMATIC {
            self.chromatic += weight;
            if is_hue_off(color, shown) {
                self.off += weight;
            }
        }
    }

    fn errors(&self) -> ColorErrors {
        let share = |part: f64, whole: f64| if whole > 0.0 { part / whole } else { 0.0 };
        ColorErrors { rmse: share(self.squares, 3.0 * self.weight).sqrt(), hue: share(self.off, self.chromatic) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: DVec3 = DVec3::X;
    const BLUE: DVec3 = DVec3::Z;

    #[test]
    fn errors_are_weighted() {
        let errors = ColorErrors::of([(3.0, RED, RED), (1.0, BLUE, DVec3::ZERO), (4.0, DVec3::ONE, DVec3::ONE)]);
        assert!((errors.rmse - (1.0f64 / 24.0).sqrt()).abs() < 1e-12, "{errors:?}");
        assert!((errors.hue - 0.25).abs() < 1e-12, "{errors:?}");
        assert_eq!(ColorErrors::of([]), ColorErrors::default());
    }

    /// Only colors that have a hue count, and only the change of their hue.
    #[test]
    fn a_hue_may_turn_by_45_degrees() {
        let hue = |color, shown| ColorErrors::of([(1.0, color, shown)]).hue;
        let [orange, yellow, tan] = [[1.0, 0.5, 0.0], [1.0, 1.0, 0.0], [0.6, 0.5, 0.4]].map(DVec3::from);
        assert_eq!([hue(RED, orange), hue(RED, yellow), hue(RED, BLUE), hue(orange, tan)], [0.0, 1.0, 1.0, 0.0]);
        assert_eq!([hue(RED, DVec3::splat(0.5)), hue(DVec3::splat(0.5), RED)], [1.0, 0.0]);
    }
}
