//! Colors with weights, which palettes are made from.

use plenoctree::{palette::Palette, sampling::Histograms};

/// Colors in encoded sRGB, each with a weight.
pub struct WeightedColors {
    /// The colors, all different, sorted by their channels.
    pub colors: Vec<[f64; 3]>,
    /// The weight of each color. They sum to 1.
    pub weights: Vec<f64>,
}

impl WeightedColors {
    /// Counts how often each color occurs.
    pub fn new(colors: &[[f64; 3]]) -> Self {
        let mut sorted = colors.to_vec();
        sorted.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])).then(a[2].total_cmp(&b[2])));
        let share = 1.0 / colors.len() as f64;
        sorted.chunk_by(|a, b| a == b).map(|same| (same[0], share * same.len() as f64)).collect()
    }

    /// Returns the centers of the fine bins that have weight.
    pub fn of_histograms(histograms: &Histograms) -> Self {
        let total = histograms.total_weight();
        let bins = histograms.fine();
        let filled = bins.iter().enumerate().filter(|(_, weight)| **weight > 0.0);
        filled.map(|(bin, weight)| (bin_center(bin, bins.len()), weight / total)).collect()
    }

    /// Makes a palette of colors found in this input, heaviest first. The weights are the shares of the input that are
    /// nearest to each color.
    pub fn palette(&self, mut colors: Vec<[f64; 3]>) -> Palette {
        let squared = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
        let mut weights = vec![0.0; colors.len()];
        for (color, weight) in self.colors.iter().zip(&self.weights) {
            let nearest =
                (0..colors.len()).min_by(|a, b| squared(color, &colors[*a]).total_cmp(&squared(color, &colors[*b])));
            nearest.into_iter().for_each(|nearest| weights[nearest] += weight);
        }
        let mut order: Vec<usize> = (0..colors.len()).collect();
        order.sort_by(|&a, &b| f64::total_cmp(&weights[b], &weights[a]));
        colors = order.iter().map(|&index| colors[index]).collect();
        let weights = order.iter().map(|&index| weights[index]).collect();
        Palette { colors, weights, method: None, ramps: vec![], shown: vec![] }
    }
}

impl FromIterator<([f64; 3], f64)> for WeightedColors {
    fn from_iter<T: IntoIterator<Item = ([f64; 3], f64)>>(items: T) -> Self {
        let (colors, weights) = items.into_iter().unzip();
        Self { colors, weights }
    }
}

/// Returns the color at the center of a bin of a histogram of `bins` bins.
pub fn bin_center(bin: usize, bins: usize) -> [f64; 3] {
    let n = (bins as f64).cbrt().round() as usize;
    [bin / (n * n), bin / n % n, bin % n].map(|index| (index as f64 + 0.5) / n as f64)
}
