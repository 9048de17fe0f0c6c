//! What a posterized picture is made of.

use glam::DVec3;

use super::colors::Palette;

/// A color of the posterized look: a palette color, or a blend of two. Equation 7, section 4 of the method.
///
/// As a color it is `share` of palette color `first` and `1 - share` of `second`: of the extracted colors where labels
/// are found, of the shown ones where they are painted.
///
/// ```
/// use plenoctree::palette::{Palette, PaletteLabel};
///
/// let palette = Palette::new(vec![[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])?;
/// let label = PaletteLabel::nearest([0.7, 0.0, 0.3].into(), &palette, 3).unwrap();
/// // After the two palette colors come the blends: a third of red, and two thirds of it.
/// assert_eq!((label.index, label.first, label.second, label.share), (3, 0, 1, 2.0 / 3.0));
/// assert_eq!(label.main_color(), 0);
/// # Ok::<(), plenoctree::palette::InvalidPalette>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaletteLabel {
    /// Its place among all labels: the palette colors come first, then the blends of every pair.
    pub index: usize,
    /// A palette color, from 0.
    pub first: usize,
    /// The other palette color of a blend, above `first`; `first` itself if the label is no blend.
    pub second: usize,
    /// Share of `first`: `k / d` in a blend, 1 if the label is none.
    pub share: f64,
}

impl PaletteLabel {
    /// All labels of a palette of `colors` colors, in order. `blend_steps` is `d`, at least 1.
    pub fn all(colors: usize, blend_steps: u32) -> impl Iterator<Item = Self> {
        let single = (0..colors).map(|color| (color, color, 1.0));
        let pairs = (0..colors).flat_map(move |first| (first + 1..colors).map(move |second| (first, second)));
        let blends = pairs.flat_map(move |(first, second)| {
            (1..blend_steps).map(move |k| (first, second, f64::from(k) / f64::from(blend_steps)))
        });
        single.chain(blends).enumerate().map(|(index, (first, second, share))| Self { index, first, second, share })
    }

    /// The label that is nearest to a color in encoded sRGB, the first of those that are equally near. `None` if the
    /// palette is empty.
    pub fn nearest(color: DVec3, palette: &Palette, blend_steps: u32) -> Option<Self> {
        let distance = |label: &Self| color.distance_squared(label.mix(&palette.colors));
        let labels = Self::all(palette.colors.len(), blend_steps).map(|label| (distance(&label), label));
        labels.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, label)| label)
    }

    /// The palette color that the label has most of: the one to change if the label is to look different.
    pub fn main_color(&self) -> usize {
        if self.share < 0.5 { self.second } else { self.first }
    }

    fn mix(&self, colors: &[[f64; 3]]) -> DVec3 {
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
    fn labels_are_those_of_equation_7() {
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
