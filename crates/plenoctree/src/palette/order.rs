//! The order of a palette's colors.

use super::{
    colors::Palette,
    kmeans::{self, Clusters},
};

/// Sorts the colors by the weight of the clusters nearest to each, heaviest first: step 9. Equal weights are sorted by
/// r, g and b.
pub(super) fn order(mut colors: Vec<[f64; 3]>, clusters: &Clusters) -> Palette {
    let by_channels = |a: &[f64; 3], b: &[f64; 3]| {
        a.iter().zip(b).map(|(a, b)| a.total_cmp(b)).find(|order| order.is_ne()).unwrap_or(std::cmp::Ordering::Equal)
    };
    colors.sort_by(by_channels);
    let mut weights = vec![0.0; colors.len()];
    for (center, weight) in clusters.centers.iter().zip(&clusters.weights) {
        weights[kmeans::nearest(center, &colors)] += weight;
    }
    let mut order: Vec<usize> = (0..colors.len()).collect();
    order.sort_by(|&a, &b| f64::total_cmp(&weights[b], &weights[a]));
    let (colors, weights) = order.iter().map(|&i| (colors[i], weights[i])).unzip();
    Palette::weighted(colors, weights)
}
