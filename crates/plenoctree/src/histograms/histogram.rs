//! Histograms of visible weight over the RGB cube.

/// Upper limit to which channels are clamped before binning, so that white falls into the last bin.
pub const MAX_CHANNEL: f64 = 0.999;

/// Histograms of visible weight over the RGB cube (encoded sRGB), one with fine and one with coarse bins.
///
/// Bin `[r][g][b]` has index `(r * bins + g) * bins + b`. The bin of channel `c` is `floor(clamp(c, 0, 0.999) * bins)`.
/// Both histograms contain the total weight of all samples. They are not normalized.
#[derive(Clone, Debug, PartialEq)]
pub struct Histograms {
    pub(crate) fine: Bins,
    pub(crate) coarse: Bins,
    pub(crate) samples: u64,
}

/// A single histogram.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Bins<T = f64> {
    pub per_channel: usize,
    pub weights: Vec<T>,
}

/// An error that occurs when a histogram does not have one finite, non-negative weight per bin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidHistogram {
    /// The number of weights is not the number of bins.
    #[error("found {found} weights, expected {per_channel} cubed")]
    Length {
        /// Number of weights found.
        found: usize,
        /// Number of bins per channel.
        per_channel: usize,
    },
    /// A weight is negative, infinite or NaN.
    #[error("the weight of bin {bin} is negative or not finite")]
    Weight {
        /// Index of the bin.
        bin: usize,
    },
}

impl Histograms {
    /// Creates histograms from weights that were computed elsewhere.
    ///
    /// `fine_bins` and `coarse_bins` are the numbers of bins per channel. `samples` is the number of radiance samples,
    /// which is only reported.
    ///
    /// # Errors
    ///
    /// Returns an error if a histogram does not have one finite, non-negative weight per bin.
    pub fn new(
        fine_bins: usize,
        fine: Vec<f64>,
        coarse_bins: usize,
        coarse: Vec<f64>,
        samples: u64,
    ) -> Result<Self, InvalidHistogram> {
        Ok(Self { fine: Bins::new(fine_bins, fine)?, coarse: Bins::new(coarse_bins, coarse)?, samples })
    }

    /// Returns the weights of the fine bins, which k-means clusters.
    pub fn fine(&self) -> &[f64] {
        &self.fine.weights
    }

    /// Returns the weights of the coarse bins, which give the initial centers of k-means.
    pub fn coarse(&self) -> &[f64] {
        &self.coarse.weights
    }

    /// Returns the number of radiance samples: leaves times direction cells, including samples without weight.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Returns the total weight of all samples.
    pub fn total_weight(&self) -> f64 {
        self.fine.weights.iter().sum()
    }
}

impl Bins {
    fn new(per_channel: usize, weights: Vec<f64>) -> Result<Self, InvalidHistogram> {
        let found = weights.len();
        if per_channel.checked_pow(3) != Some(found) {
            return Err(InvalidHistogram::Length { found, per_channel });
        }
        match weights.iter().position(|w| !w.is_finite() || *w < 0.0) {
            Some(bin) => Err(InvalidHistogram::Weight { bin }),
            None => Ok(Self { per_channel, weights }),
        }
    }

    /// Returns the share of each bin in the weight of all bins, even if that is beyond the range of float64.
    pub fn shares(&self) -> impl Iterator<Item = f64> {
        shares(&self.weights)
    }

    /// Returns the color at the center of a bin.
    pub fn center(&self, bin: usize) -> [f64; 3] {
        let n = self.per_channel;
        [bin / (n * n), bin / n % n, bin % n].map(|i| (i as f64 + 0.5) / n as f64)
    }
}

/// Returns the share of each weight in all of them, even if their sum is beyond the range of float64. Without any weight,
/// shares are NaN.
pub(crate) fn shares(weights: &[f64]) -> impl Iterator<Item = f64> {
    let total = |scale: f64| weights.iter().map(|weight| scale * weight).sum::<f64>();
    // A power of two changes no digits.
    let scale = if total(1.0).is_finite() { 1.0 } else { (-64f64).exp2() };
    let total = total(scale);
    weights.iter().map(move |weight| scale * weight / total)
}

/// Histograms being filled.
///
/// Weights are added as integers, so that the sum does not depend on the order in which threads add them.
pub(crate) struct Tally {
    fine: Bins<u64>,
    coarse: Bins<u64>,
    scale: f64,
}

impl Tally {
    /// Creates empty histograms for weights whose sum is at most `most`, or 0 if there are none.
    pub fn new(fine_bins: usize, coarse_bins: usize, most: f64) -> Self {
        // A power of two makes scaling exact. Two bits are left for rounding.
        let exponent = if most > 0.0 { most.log2().ceil().max(-900.0) } else { 0.0 };
        let scale = (62.0 - exponent).exp2();
        Self { fine: Bins::empty(fine_bins), coarse: Bins::empty(coarse_bins), scale }
    }

    /// Adds a radiance sample.
    pub fn add(&mut self, color: [f64; 3], weight: f64) {
        let weight = (weight * self.scale + 0.5) as u64;
        self.fine.add(color, weight);
        self.coarse.add(color, weight);
    }

    /// Returns the sum of two tallies that were created with the same arguments.
    pub fn merge(mut self, other: Self) -> Self {
        self.fine.merge(&other.fine);
        self.coarse.merge(&other.coarse);
        self
    }

    /// Returns the histograms, with every weight multiplied by `factor`.
    pub fn finish(self, factor: f64, samples: u64) -> Histograms {
        let bins = |Bins { per_channel, weights }: Bins<u64>| Bins {
            per_channel,
            weights: weights.into_iter().map(|weight| weight as f64 * factor / self.scale).collect(),
        };
        Histograms { fine: bins(self.fine), coarse: bins(self.coarse), samples }
    }
}

impl Bins<u64> {
    fn empty(per_channel: usize) -> Self {
        Self { per_channel, weights: vec![0; per_channel.pow(3)] }
    }

    fn add(&mut self, color: [f64; 3], weight: u64) {
        let n = self.per_channel;
        let [r, g, b] = color.map(|c| (c.clamp(0.0, MAX_CHANNEL) * n as f64) as usize);
        self.weights[(r * n + g) * n + b] += weight;
    }

    fn merge(&mut self, other: &Self) {
        self.weights.iter_mut().zip(&other.weights).for_each(|(a, b)| *a += b);
    }
}

#[cfg(test)]
impl Histograms {
    /// Returns histograms of weighted colors, with this many fine bins per channel.
    pub(crate) fn of(fine: usize, colors: &[([f64; 3], f64)]) -> Self {
        let bins = |n: usize| {
            let mut weights = vec![0.0; n.pow(3)];
            for (color, weight) in colors {
                let [r, g, b] = color.map(|c| ((c * n as f64) as usize).min(n - 1));
                weights[(r * n + g) * n + b] += weight;
            }
            weights
        };
        Self::new(fine, bins(fine), 8, bins(8), 0).unwrap()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Histograms conserve weight: none is lost, for any colors, and both histograms contain all of it.
        #[test]
        fn weight_is_preserved(
            samples in prop::collection::vec((prop::array::uniform3(-0.5..1.5f64), 0.0..6e4f64), 1..200),
        ) {
            let total: f64 = samples.iter().map(|(_, weight)| weight).sum();
            let mut tally = Tally::new(32, 8, total);
            samples.iter().for_each(|&(color, weight)| tally.add(color, weight));
            let histograms = tally.finish(1.0, samples.len() as u64);
            prop_assert!((histograms.total_weight() - total).abs() <= 1e-12 * total);
            prop_assert!((histograms.coarse().iter().sum::<f64>() - total).abs() <= 1e-12 * total);
        }

        /// The center of a bin falls into that bin.
        #[test]
        fn centers_lie_in_their_bins(per_channel in 1usize..=64, bin: prop::sample::Index) {
            let bin = bin.index(per_channel.pow(3));
            let mut tally = Tally::new(per_channel, 1, 1.0);
            let center = Bins::<f64> { per_channel, weights: vec![] }.center(bin);
            tally.add(center, 1.0);
            prop_assert_eq!(tally.finish(1.0, 1).fine()[bin], 1.0);
        }
    }

    #[test]
    fn bins_follow_the_method() {
        let mut tally = Tally::new(32, 8, 8.0);
        tally.add([1.0, 0.5, -3.0], 2.0);
        let histograms = tally.finish(1.0, 1);
        assert_eq!(histograms.fine()[31 * 1024 + 16 * 32], 2.0);
        assert_eq!(histograms.coarse()[7 * 64 + 4 * 8], 2.0);
    }

    /// The announced sum fits even if every sample is rounded up.
    #[test]
    fn the_announced_sum_fits() {
        for most in [1e-30, 1.0, 3.0, 1e12, 1e300] {
            let mut tally = Tally::new(1, 1, most);
            (0..1000).for_each(|_| tally.add([0.5; 3], most / 1000.0));
            let total = tally.finish(1.0, 1000).total_weight();
            assert!((total / most - 1.0).abs() < 1e-12, "{total} of {most}");
        }
    }

    #[test]
    fn histograms_are_checked() {
        assert_eq!(
            Histograms::new(2, vec![0.0; 7], 1, vec![0.0], 0),
            Err(InvalidHistogram::Length { found: 7, per_channel: 2 })
        );
        assert_eq!(Histograms::new(1, vec![1.0], 1, vec![-1.0], 0), Err(InvalidHistogram::Weight { bin: 0 }));
    }
}
