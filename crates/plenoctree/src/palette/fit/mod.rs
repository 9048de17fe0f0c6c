//! Palettes that are fitted to their own labels: section 3 of the method, step 10.

use glam::DVec3;

use super::{colors::Palette, extract::order, kmeans::Clusters, label::PaletteLabel};
use crate::sampling::Bins;

/// The colors of a histogram.
pub(super) struct Cloud {
    colors: Vec<[f64; 3]>,
    /// The colors' shares of the weight, which sum to 1.
    weights: Vec<f64>,
}

impl Cloud {
    /// Returns the colors of a histogram, or `None` if it has no weight.
    pub fn new(bins: &Bins) -> Option<Self> {
        let total: f64 = bins.weights.iter().sum();
        let seen = bins.weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0);
        let (colors, weights): (Vec<_>, Vec<_>) = seen.map(|(bin, weight)| (bins.center(bin), weight / total)).unzip();
        (!colors.is_empty()).then_some(Self { colors, weights })
    }

    /// Returns the palette of at most `colors` colors whose labels are nearest to the colors of the cloud.
    pub fn fit(&self, colors: usize, blend_steps: u32) -> Palette {
        let points: Vec<DVec3> = self.colors.iter().map(|&point| point.into()).collect();
        let mut palette = seeds(&points, &self.weights, colors).unwrap_or_default();
        for _ in 0..40 {
            palette = step(&points, &self.weights, &palette, blend_steps);
        }
        let clusters = Clusters { centers: self.colors.clone(), weights: self.weights.clone() };
        order(palette.into_iter().map(Into::into).collect(), &clusters)
    }
}

fn seeds(cloud: &[DVec3], weights: &[f64], count: usize) -> Option<Vec<DVec3>> {
    let mut far = vec![1.0; cloud.len()];
    let mut seeds = Vec::new();
    while seeds.len() < count {
        let score = |i: usize| weights[i].sqrt() * far[i];
        let best = (0..cloud.len()).reduce(|a, b| if score(b) > score(a) { b } else { a })?;
        if score(best) <= 0.0 {
            break;
        }
        seeds.push(cloud[best]);
        far.iter_mut().zip(cloud).for_each(|(far, point)| *far = f64::min(*far, point.distance_squared(cloud[best])));
    }
    Some(seeds)
}

fn step(cloud: &[DVec3], weights: &[f64], palette: &[DVec3], blend_steps: u32) -> Vec<DVec3> {
    let n = palette.len();
    let labels: Vec<PaletteLabel> = PaletteLabel::all(n, blend_steps).collect();
    let colors: Vec<[f64; 3]> = palette.iter().map(|&color| color.into()).collect();
    let mixed: Vec<DVec3> = labels.iter().map(|label| label.mix(&colors)).collect();
    let mut matrix = vec![vec![0.0; n]; n];
    let mut right = vec![DVec3::ZERO; n];
    for (i, &color) in palette.iter().enumerate() {
        matrix[i][i] = 1e-4;
        right[i] = 1e-4 * color;
    }
    for (&point, &weight) in cloud.iter().zip(weights) {
        let near = (0..mixed.len())
            .fold(0, |a, b| if mixed[b].distance_squared(point) < mixed[a].distance_squared(point) { b } else { a });
        let PaletteLabel { first, second, share, .. } = labels[near];
        let parts = if first == second { vec![(first, 1.0)] } else { vec![(first, share), (second, 1.0 - share)] };
        for &(i, a) in &parts {
            right[i] += weight * a * point;
            parts.iter().for_each(|&(j, b)| matrix[i][j] += weight * a * b);
        }
    }
    for i in 0..n {
        for j in i + 1..n {
            let factor = matrix[j][i] / matrix[i][i];
            for k in i..n {
                matrix[j][k] -= factor * matrix[i][k];
            }
            right[j] = right[j] - factor * right[i];
        }
    }
    for i in (0..n).rev() {
        for j in i + 1..n {
            right[i] = right[i] - matrix[i][j] * right[j];
        }
        right[i] /= matrix[i][i];
    }
    right.into_iter().map(|color| color.clamp(DVec3::ZERO, DVec3::ONE)).collect()
}
