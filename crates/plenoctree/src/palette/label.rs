//! The labels of a palette, which make up a posterized image.

use glam::DVec3;

use super::colors::Palette;

/// A label: a palette color, or a blend of two. Section 4 of the method, step 1 (equation 7 of the paper).
///
/// Its color is `share` of palette color `first` plus `1 - share` of palette color `second`. Pixels are compared to
/// this blend of the source colors, and replaced with the same blend of the shown colors.
///
/// ```
/// use plenoctree::palette::{Palette, PaletteLabel};
///
/// let palette = Palette::new(vec![[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])?;
/// let label = PaletteLabel::nearest([0.7, 0.0, 0.3].into(), &palette, 3).unwrap();
/// // The two palette colors come first, then the blends: a third of red, and two thirds of red.
/// assert_eq!((label.index, label.first, label.second, label.share), (3, 0, 1, 2.0 / 3.0));
/// assert_eq!(label.main_color(), 0);
/// # Ok::<(), plenoctree::palette::InvalidPalette>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaletteLabel {
    /// Index among all labels: the palette colors come first, then the blends of every pair.
    pub index: usize,
    /// Index of the first palette color.
    pub first: usize,
    /// Index of the second palette color of a blend, greater than `first`. Equal to `first` if the label is not a
    /// blend.
    pub second: usize,
    /// Share of `first`, 0 to 1: `k / d` if the label is a blend, else 1.
    pub share: f64,
}

impl PaletteLabel {
    /// Maximum number of labels with which a palette is drawn: every pixel is compared to all of them.
    pub const MAX_LABELS: usize = 1024;

    /// Returns the number of labels of a palette of `colors` colors. `blend_steps` is `d`, at least 1.
    pub fn count(colors: usize, blend_steps: u32) -> usize {
        let pairs = colors.saturating_mul(colors.saturating_sub(1)) / 2;
        let blends = blend_steps.saturating_sub(1) as usize;
        colors.saturating_add(pairs.saturating_mul(blends))
    }

    /// Returns the largest number of blend steps, `d`, with which a palette of `colors` colors has no more than
    /// [`Self::MAX_LABELS`] labels, but at least 1: 68 for 6 colors, 3 for 32 and 1 for 64.
    pub fn most_blend_steps(colors: usize) -> u32 {
        let pairs = colors.saturating_mul(colors.saturating_sub(1)) / 2;
        let blends = Self::MAX_LABELS.saturating_sub(colors).checked_div(pairs);
        blends.map_or(u32::MAX, |blends| blends as u32 + 1)
    }

    /// Returns all labels of a palette of `colors` colors, in order. `blend_steps` is `d`, at least 1.
    pub fn all(colors: usize, blend_steps: u32) -> impl Iterator<Item = Self> {
        let single = (0..colors).map(|color| (color, color, 1.0));
        let pairs = (0..colors).flat_map(move |first| (first + 1..colors).map(move |second| (first, second)));
        let blends = pairs.flat_map(move |(first, second)| {
            (1..blend_steps).map(move |k| (first, second, f64::from(k) / f64::from(blend_steps)))
        });
        single.chain(blends).enumerate().map(|(index, (first, second, share))| Self { index, first, second, share })
    }

    /// Returns the label of `palette` that is nearest to `color` in encoded sRGB, by distance in the palette's
    /// [`label_space`](Palette::label_space), or `None` if the palette is empty. Ties go to the first label.
    pub fn nearest(color: DVec3, palette: &Palette, blend_steps: u32) -> Option<Self> {
        let space = palette.label_space();
        let place = space.place(color);
        let distance = |label: &Self| place.distance_squared(space.place(label.mix(&palette.colors)));
        let labels = Self::all(palette.colors.len(), blend_steps).map(|label| (distance(&label), label));
        labels.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, label)| label)
    }

    /// Returns the index of the palette color with the larger share: the one to edit in order to change the label.
    pub fn main_color(&self) -> usize {
        if self.share < 0.5 { self.second } else { self.first }
    }

    /// Returns the label's color, blended from the palette's `colors`.
    pub(super) fn mix(&self, colors: &[[f64; 3]]) -> DVec3 {
        let [first, second] = [self.first, self.second].map(|color| DVec3::from(colors[color]));
        self.share * first + (1.0 - self.share) * second
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference;

    fn palette(colors: usize) -> Palette {
        let channel = |i: usize, by: f64| (0.5 + 0.5 * (by * i as f64).sin()).clamp(0.0, 1.0);
        Palette::new((0..colors).map(|i| [channel(i, 1.0), channel(i, 2.3), channel(i, 4.1)]).collect()).unwrap()
    }

    #[test]
    fn labels_match_the_reference() {
        for (colors, steps) in [(1, 3), (2, 1), (6, 3), (5, 8)] {
            let palette = palette(colors);
            let vectors: Vec<DVec3> = palette.colors.iter().copied().map(DVec3::from).collect();
            let expected = reference::labels(&vectors, steps);
            let found: Vec<PaletteLabel> = PaletteLabel::all(colors, steps).collect();
            assert_eq!(found.len(), expected.len());
            for (index, (label, expected)) in found.iter().zip(expected).enumerate() {
                assert_eq!(label.index, index);
                assert!((label.mix(&palette.colors) - expected).length() < 1e-15, "{label:?}");
            }
        }
    }

    #[test]
    fn labels_are_bounded() {
        for colors in 0..=Palette::MAX_COLORS {
            for steps in 1..=8 {
                assert_eq!(PaletteLabel::count(colors, steps), PaletteLabel::all(colors, steps).count());
            }
            let most = PaletteLabel::most_blend_steps(colors);
            assert!(PaletteLabel::count(colors, most) <= PaletteLabel::MAX_LABELS, "{colors}: {most}");
            assert!(colors < 2 || PaletteLabel::count(colors, most + 1) > PaletteLabel::MAX_LABELS, "{colors}: {most}");
        }
        assert_eq!([6, 32, 64].map(PaletteLabel::most_blend_steps), [68, 3, 1]);
    }

    #[test]
    fn every_label_is_nearest_to_its_own_color() {
        let palette = palette(6);
        for label in PaletteLabel::all(6, 4) {
            assert_eq!(PaletteLabel::nearest(label.mix(&palette.colors), &palette, 4), Some(label));
        }
    }

    #[test]
    fn equal_colors_have_the_first_label() {
        let palette = Palette::new(vec![[0.5; 3]; 3]).unwrap();
        assert_eq!(PaletteLabel::nearest(DVec3::ONE, &palette, 3).map(|label| label.index), Some(0));
    }
}
