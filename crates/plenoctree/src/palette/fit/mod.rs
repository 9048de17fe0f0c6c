//! Palettes that are fitted to their own labels: section 3 of the method, step 10.

mod labels;
mod points;
mod search;

use glam::DVec3;

use super::{colors::Palette, kmeans::Clusters, order::order};
use crate::sampling::{Bins, Canceled, Progress};
use points::{Points, variance};

/// The colors of a histogram, to which palettes are fitted.
pub(super) struct Cloud {
    bins: Clusters,
    /// The weights that the fit uses: those of rare colors count more than their share.
    salient: Vec<f64>,
    /// The variance of the colors with these weights.
    variance: f64,
    per_channel: usize,
}

/// How colors are merged into fewer points.
struct Merging {
    /// Number of cells per channel of the coarsest lattice. Finer ones have twice as many, up to the bins themselves.
    coarsest: usize,
    /// Share of the variance of the colors that may be lost within the cells. Where most colors are similar, such as in
    /// a dark field, coarse cells lose more.
    lost: f64,
    /// Number of points beyond which colors are not told apart better, because it would take too long.
    most: usize,
}

/// The points to search with, and those to fit to.
const FEW: Merging = Merging { coarsest: 8, lost: 0.015, most: 1000 };
const MANY: Merging = Merging { coarsest: 16, lost: 0.004, most: 5000 };

/// Number of points per palette color for which a lattice is fine enough.
const ENOUGH: usize = 12;

impl Cloud {
    /// Returns the colors of a histogram, or `None` if it has no weight.
    pub fn new(bins: &Bins) -> Option<Self> {
        // The sum of the heaviest weights might be infinite, but not that of their shares of the largest.
        let most = bins.weights.iter().copied().fold(0.0, f64::max);
        let total: f64 = bins.weights.iter().map(|weight| weight / most).sum();
        let seen = bins.weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0);
        let (centers, weights): (Vec<_>, Vec<_>) =
            seen.map(|(bin, weight)| (bins.center(bin), weight / most / total)).unzip();
        let per_channel = bins.per_channel;
        let salient = salient(&centers, &weights);
        let variance = variance(centers.iter().map(|center| DVec3::from(*center)).zip(salient.iter().copied()));
        (!centers.is_empty()).then_some(Self { bins: Clusters { centers, weights }, salient, variance, per_channel })
    }

    /// Returns the palette of at most `colors` colors whose labels are nearest to the colors of the cloud, with its
    /// heaviest color first. It has fewer colors if the cloud has fewer, or if fewer fit as well.
    pub fn fit(&self, colors: usize, blend_steps: u32, progress: &Progress) -> Result<Palette, Canceled> {
        let Clusters { centers, .. } = &self.bins;
        let found = if centers.len() <= colors {
            centers.clone()
        } else {
            let few = self.merged(&FEW, ENOUGH * colors, progress)?;
            let many = self.merged(&MANY, ENOUGH * colors, progress)?;
            search::search(&few, &many, colors, blend_steps, progress)
        };
        progress.check()?;
        Ok(order(found, &self.bins))
    }

    /// Returns the colors, merged in the coarsest lattice that keeps at least `least` points and enough of their
    /// variance, or not merged if none does.
    fn merged(&self, merging: &Merging, least: usize, progress: &Progress) -> Result<Points, Canceled> {
        let Clusters { centers, weights } = &self.bins;
        let merge = |lattice: usize| {
            progress.check()?;
            Ok(Points::new(centers, weights, &self.salient, lattice.min(self.per_channel)))
        };
        let mut lattice = merging.coarsest;
        let mut points = merge(lattice)?;
        while lattice < self.per_channel {
            let enough = points.all.len() >= least;
            if enough && points.variance() >= (1.0 - merging.lost) * self.variance {
                break;
            }
            lattice *= 2;
            let finer = merge(lattice)?;
            if enough && finer.all.len() > merging.most {
                break;
            }
            points = finer;
        }
        Ok(points)
    }
}

/// The weight of a group of similar colors counts like its share to this power, so that small but distinct colors are
/// not lost among large ones.
const SALIENCE: f64 = 0.78;

/// Returns weights of colors that sum to 1, where the colors in each cell of an 8 x 8 x 8 lattice weigh together as
/// [`SALIENCE`] says.
fn salient(colors: &[[f64; 3]], weights: &[f64]) -> Vec<f64> {
    let group = |color: &[f64; 3]| color.iter().fold(0, |index, c| 8 * index + ((8.0 * c) as usize).min(7));
    let mut groups = [0.0; 512];
    colors.iter().zip(weights).for_each(|(color, weight)| groups[group(color)] += weight);
    let total: f64 = groups.iter().map(|weight: &f64| weight.powf(SALIENCE)).sum();
    let raised = |(color, weight): (&[f64; 3], &f64)| weight * groups[group(color)].powf(SALIENCE - 1.0) / total;
    colors.iter().zip(weights).map(raised).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::{
        palette::{ColorCount, ColorErrors, ExtractionSettings, PaletteMethod, extract_from_samples},
        sampling::Histograms,
    };

    fn fit(colors: &[([f64; 3], f64)], count: usize) -> (Palette, ColorErrors) {
        let settings = ExtractionSettings { colors: ColorCount::Fixed(count), ..fitted() };
        let extraction =
            extract_from_samples(&Histograms::of(32, colors), &[], &settings, &Progress::default()).unwrap();
        (extraction.palette, extraction.report.errors)
    }

    fn fitted() -> ExtractionSettings {
        ExtractionSettings { method: PaletteMethod::Fitted, ..Default::default() }
    }

    /// Returns a few lumps of colors, of which one is gray, inside the hull of the others, and heavy.
    fn lumps() -> Vec<([f64; 3], f64)> {
        let lumps = [[0.1; 3], [0.9; 3], [0.8, 0.1, 0.1], [0.1, 0.7, 0.2], [0.2, 0.2, 0.8], [0.5, 0.42, 0.36]];
        let spread = |i: usize| (0..3).map(move |axis| 0.06 * (1.7 * i as f64 + 2.1 * f64::from(axis)).sin());
        let lump = |lump: [f64; 3]| {
            (0..60).map(move |i| {
                let mut color = lump;
                color.iter_mut().zip(spread(i)).for_each(|(c, by)| *c += by);
                (color, 1.0 + (i % 7) as f64)
            })
        };
        lumps.into_iter().flat_map(lump).collect()
    }

    /// Returns the largest difference of a channel between the colors of a palette and the nearest of the other.
    fn moved(a: &Palette, b: &Palette) -> f64 {
        let apart = |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|axis| (a[axis] - b[axis]).abs()).fold(0.0, f64::max);
        let nearest = |a: &[f64; 3]| b.colors.iter().map(|b| apart(a, b)).fold(f64::INFINITY, f64::min);
        a.colors.iter().map(nearest).fold(0.0, f64::max)
    }

    /// Figure 11 of the paper: the hull has no color inside the others.
    #[test]
    fn colors_inside_the_hull_are_found() {
        let (palette, errors) = fit(&lumps(), 6);
        let distance = |c: &[f64; 3]| c.iter().zip([0.5, 0.42, 0.36]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(palette.colors.iter().any(|color| distance(color) < 0.06), "{palette:?}");
        let hull = ExtractionSettings { method: PaletteMethod::Hull, ..Default::default() };
        let hull = extract_from_samples(&Histograms::of(32, &lumps()), &[], &hull, &Progress::default()).unwrap();
        let hull = hull.report.errors;
        assert!(errors.rmse < 0.88 * hull.rmse && errors.hue <= hull.hue, "{errors:?}, by the hull {hull:?}");
    }

    /// One percent of noise in every bin moves no color by more than 0.05, and the same bins give the same bits.
    #[test]
    fn noise_moves_palettes_little() {
        let (palette, _) = fit(&lumps(), 6);
        assert_eq!(fit(&lumps(), 6).0, palette);
        for seed in 1..=3 {
            let mut noisy = lumps();
            for (i, (_, weight)) in noisy.iter_mut().enumerate() {
                *weight *= 1.0 + 0.02 * (f64::from(seed) * 1e3 * (i as f64 + 0.5).sin()).sin();
            }
            let (other, _) = fit(&noisy, 6);
            assert_eq!(other.colors.len(), palette.colors.len());
            assert!(moved(&palette, &other).max(moved(&other, &palette)) < 0.05, "{palette:?} {other:?}");
        }
    }

    /// A field with no more colors than requested keeps them all, regardless of where they are.
    #[test]
    fn few_colors_are_all_kept() {
        let center = |i: u32| (f64::from(i) + 0.5) / 32.0;
        let line: Vec<_> = (0..5u32).map(|i| ([center(2 + 5 * i); 3], 1.0)).collect();
        let plane: Vec<_> = (0..6u32).map(|i| ([center(4 * i), center(i * i), 0.5 / 32.0], 1.0)).collect();
        let black = vec![([0.5 / 32.0; 3], 3.0)];
        let two = vec![([center(3); 3], 1e-9), ([center(30), center(1), center(7)], 1.0)];
        for colors in [line, plane, black, two] {
            for wanted in [6, 64] {
                let (palette, errors) = fit(&colors, wanted);
                assert_eq!(palette.colors.len(), colors.len());
                assert!(errors.rmse < 1e-12, "{errors:?}");
                assert!(colors.iter().all(|(color, _)| palette.colors.contains(color)));
            }
        }
    }

    /// Eight colors at the corners of a cube, of which six are wanted: no palette has fewer just because labels are
    /// soft while it is fitted.
    #[test]
    fn colors_far_apart_are_not_merged() {
        let corner = |i: usize| [i & 1, i >> 1 & 1, i >> 2].map(|bit| if bit == 1 { 28.5 / 32.0 } else { 3.5 / 32.0 });
        let corners: Vec<_> = (0..8).map(|i| (corner(i), if i < 4 { 0.077 } else { 0.173 })).collect();
        let (palette, errors) = fit(&corners, 6);
        assert_eq!(palette.colors.len(), 6);
        // The lowest that a search with random starts found is 0.101.
        assert!(errors.rmse < 0.12, "{errors:?}");
    }

    /// Flat colors, as of toys or voxel art, are shown better than by the hull, if there are more of them than wanted.
    #[test]
    fn flat_colors_are_shown_better_than_by_the_hull() {
        let channel = |x: f64| 0.5 + 0.48 * (1e4 * x.sin()).sin();
        for seed in (0..24).step_by(3) {
            let number = |i: usize| f64::from(seed) + 0.1 * i as f64;
            let color =
                |i: usize| ([0.1, 0.2, 0.3].map(|at| channel(number(i) + at)), channel(number(i) + 0.4).powi(2));
            let colors: Vec<_> = (0..8 + seed as usize % 10).map(color).collect();
            let (palette, errors) = fit(&colors, 6);
            assert_eq!(palette.colors.len(), 6, "{seed}");
            let hull = ExtractionSettings { method: PaletteMethod::Hull, ..Default::default() };
            let hull = extract_from_samples(&Histograms::of(32, &colors), &[], &hull, &Progress::default()).unwrap();
            // A cloud whose hull cannot be simplified has more colors.
            if hull.palette.colors.len() <= 6 {
                let hull = hull.report.errors;
                assert!(errors.rmse < hull.rmse, "{seed}: {errors:?}, by the hull {hull:?}");
            }
        }
    }

    /// Dark shades that are near to each other have different labels if they are most of what is seen.
    #[test]
    fn dark_shades_are_told_apart() {
        let shades = [[0.02, 0.02, 0.02], [0.1, 0.02, 0.02], [0.02, 0.04, 0.1], [0.1, 0.1, 0.05]];
        let faint = (0..216).map(|i| ([i / 36, i / 6 % 6, i % 6].map(|c| 0.1 + 0.16 * f64::from(c)), 0.01));
        let (_, errors) = fit(&shades.map(|shade| (shade, 100.0)).into_iter().chain(faint).collect::<Vec<_>>(), 5);
        // With one label for all shades, it is 0.042.
        assert!(errors.rmse < 0.025, "{errors:?}");
    }

    /// Many colors on a line or in a plane have a palette on it, whose colors are distinct and seen.
    #[test]
    fn flat_clouds_have_palettes() {
        let line: Vec<_> = (0..32u32).map(|i| ([(f64::from(i) + 0.5) / 32.0; 3], 1.0)).collect();
        let plane: Vec<_> =
            (0..1024u32).map(|i| ([i / 32, i % 32, 0].map(|i| (f64::from(i) + 0.5) / 32.0), 1.0)).collect();
        for (colors, most) in [(line, 0.02), (plane, 0.07)] {
            let (palette, errors) = fit(&colors, 6);
            assert!(palette.weights.iter().all(|weight| *weight > 0.0), "{palette:?}");
            assert!(errors.rmse < most, "{errors:?}");
            for (i, a) in palette.colors.iter().enumerate() {
                assert!(palette.colors[..i].iter().all(|b| a != b), "{palette:?}");
            }
        }
    }

    /// Weights may be so large that their sum is infinite, or so small that their squares vanish.
    #[test]
    fn the_scale_of_weights_does_not_matter() {
        let (palette, errors) = fit(&lumps(), 6);
        for scale in [1e306, 1e-300] {
            let scaled: Vec<_> = lumps().into_iter().map(|(color, weight)| (color, scale * weight)).collect();
            let (other, scaled) = fit(&scaled, 6);
            assert!(moved(&palette, &other) < 1e-4, "{palette:?} {other:?}");
            assert!((scaled.rmse - errors.rmse).abs() < 1e-6 && (scaled.hue - errors.hue).abs() < 1e-6);
        }
    }

    proptest! {
        /// Any colors have a palette in the cube, with weights that sum to 1, of at most as many colors as wanted.
        #[test]
        fn any_colors_have_a_palette(
            colors in prop::collection::vec((prop::array::uniform3(0.0..1.0f64), -12.0..6.0f64), 1..300),
            wanted in 1usize..=9,
        ) {
            let colors: Vec<_> = colors.into_iter().map(|(color, exponent)| (color, exponent.exp())).collect();
            let (palette, errors) = fit(&colors, wanted);
            prop_assert_eq!(palette.validate(), Ok(()));
            prop_assert!(palette.colors.len() <= wanted);
            prop_assert!(palette.colors.as_flattened().iter().all(|channel| (0.0..=1.0).contains(channel)));
            prop_assert!((palette.weights.iter().sum::<f64>() - 1.0).abs() < 1e-9);
            prop_assert!(errors.rmse.is_finite() && (0.0..=1.0).contains(&errors.hue));
        }
    }
}
