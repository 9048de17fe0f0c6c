//! Palettes as other methods find them, to compare with the field's.
//!
//! | palette | method |
//! |---|---|
//! | [`tan`] | the convex hull of the given colors, simplified (Tan et al. 2016) |
//! | [`wang`] | such a hull, optimized to be nearer to the colors (Wang et al. 2019) |
//! | [`chao`] | k-means with 40 clusters, then the hull of their centers (Chao et al. 2021) |
//! | [`clustered`] | k-means from given centers, then the hull of the clusters |
//! | [`mean_shift`] | the modes of the weighted colors instead of k-means, then their hull |
//!
//! All of them use the hull simplification of the field's palette, so that only what is compared differs. The weights
//! of their colors are the shares of their own input that is nearest to each.

mod colors;
mod mean_shift;
mod raw_samples;
mod solid;
mod wang;

pub use colors::WeightedColors;
pub use mean_shift::mean_shift;
pub use raw_samples::{RawSample, RawSamples, transmittance};
pub use wang::wang;

use plenoctree::{
    palette::{ExtractionSettings, InvalidPalette, Palette, k_means, simplify_hull},
    random::Random,
};

/// K: the number of clusters of Chao et al., as in appendix B of the paper.
const CHAO_CLUSTERS: usize = 40;

/// Returns the corners of the colors' convex hull, simplified to at most `max_colors`: Tan et al. 2016.
pub fn tan(input: &WeightedColors, max_colors: usize) -> Result<Palette, InvalidPalette> {
    Ok(input.palette(simplify_hull(&input.colors, max_colors)?.colors))
}

/// Clusters the colors with k-means, and returns the simplified hull of the clusters: Chao et al. 2021.
///
/// Their initial centers are random. These are k-means++ with a fixed seed.
pub fn chao(input: &WeightedColors, max_colors: usize) -> Result<Palette, InvalidPalette> {
    clustered(input, &seeds(input, CHAO_CLUSTERS), max_colors)
}

/// Clusters the colors with k-means from the given centers, and returns the simplified hull of the clusters.
pub fn clustered(input: &WeightedColors, centers: &[[f64; 3]], max_colors: usize) -> Result<Palette, InvalidPalette> {
    let centers = k_means(&input.colors, &input.weights, centers, &ExtractionSettings::default())?;
    Ok(input.palette(simplify_hull(&centers, max_colors)?.colors))
}

/// Returns an index with a probability proportional to its chance, or `None` if all chances are 0.
fn pick(random: &mut Random, chances: &[f64]) -> Option<usize> {
    let mut left = random.fraction() * chances.iter().sum::<f64>();
    let mut last = None;
    for (index, chance) in chances.iter().enumerate().filter(|(_, chance)| **chance > 0.0) {
        last = Some(index);
        left -= chance;
        if left < 0.0 {
            break;
        }
    }
    last
}

/// Chooses initial centers like k-means++: each with a probability proportional to its weight and to its squared
/// distance from the nearest one before.
fn seeds(input: &WeightedColors, count: usize) -> Vec<[f64; 3]> {
    let mut random = Random::new(2021);
    let mut chances = input.weights.clone();
    let mut distances = vec![f64::INFINITY; chances.len()];
    let mut centers = Vec::new();
    while centers.len() < count.min(input.colors.len()) {
        let Some(chosen) = pick(&mut random, &chances) else { break };
        let center = input.colors[chosen];
        centers.push(center);
        for (index, color) in input.colors.iter().enumerate() {
            let squared = color.iter().zip(&center).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
            distances[index] = squared.min(distances[index]);
            chances[index] = input.weights[index] * distances[index];
        }
    }
    centers
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::{solid::Solid, *};

    fn cloud(count: usize) -> Vec<[f64; 3]> {
        let mut random = Random::new(7);
        (0..count).map(|_| std::array::from_fn(|_| 0.35 + 0.3 * random.fraction() * random.fraction())).collect()
    }

    /// The simplified hull only grows, so it contains every color, as long as no corner leaves the RGB cube.
    #[test]
    fn tans_hull_contains_all_colors() {
        let colors = cloud(2000);
        let palette = tan(&WeightedColors::new(&colors), 6).unwrap();
        assert!(palette.colors.len() <= 6);
        assert!(palette.colors.iter().flatten().all(|c| (1e-6..1.0 - 1e-6).contains(c)), "{palette:?}");
        let hull = Solid::new(&palette.colors.iter().map(|&color| color.into()).collect::<Vec<_>>());
        let farthest = colors.iter().map(|&color| hull.distance(DVec3::from(color))).fold(0.0, f64::max);
        assert!(farthest < 1e-9, "{farthest}");
    }

    /// Eight clusters at the corners of a box, and k-means with 40 centers, give the box back.
    #[test]
    fn chao_finds_the_corners_of_a_box() {
        let mut random = Random::new(3);
        let corner = |bit: usize, corner: usize| if corner >> bit & 1 == 1 { 0.8 } else { 0.2 };
        let colors: Vec<[f64; 3]> = (0..4000)
            .map(|i| std::array::from_fn(|axis| corner(axis, i % 8) + 0.02 * (random.fraction() - 0.5)))
            .collect();
        let palette = chao(&WeightedColors::new(&colors), 8).unwrap();
        assert_eq!(palette.colors.len(), 8);
        for color in &palette.colors {
            assert!(color.iter().all(|c| (c - 0.2).abs().min((c - 0.8).abs()) < 0.03), "{color:?}");
        }
    }

    /// Colors without volume have palettes too.
    #[test]
    fn flat_colors_have_palettes() {
        let gray = WeightedColors::new(&[[0.5; 3]; 10]);
        let line = WeightedColors::new(&[[0.1; 3], [0.2; 3], [0.7; 3]]);
        let plane = WeightedColors::new(&[[0.1, 0.1, 0.5], [0.9, 0.1, 0.5], [0.1, 0.9, 0.5], [0.2, 0.2, 0.5]]);
        for (input, corners) in [(gray, 1), (line, 2), (plane, 3)] {
            for palette in [tan(&input, 6).unwrap(), chao(&input, 6).unwrap(), wang(&input, 6).unwrap().palette] {
                assert_eq!(palette.colors.len(), corners);
                assert!((palette.weights.iter().sum::<f64>() - 1.0).abs() < 1e-9);
            }
        }
    }
}
