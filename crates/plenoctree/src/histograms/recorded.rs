//! The histograms of the field that a packed field was made from. Its file may record them, because packing changes
//! colors and drops leaves, which changes palettes a little.

use super::{
    histogram::{Bins, Histograms},
    settings::SamplingSettings,
};

/// The fine histogram of a field, and how it was sampled.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Recorded {
    /// The number of bins is that of the fine histogram.
    pub settings: SamplingSettings,
    /// The number of radiance samples.
    pub samples: u64,
    /// The weight of each bin.
    pub weights: Vec<f64>,
}

impl Recorded {
    /// Returns `None` if there is no weight.
    #[cfg(feature = "write")]
    pub fn new(settings: &SamplingSettings, histograms: &Histograms) -> Option<Self> {
        histograms.total_weight().is_normal().then(|| Self {
            settings: settings.clone(),
            samples: histograms.samples(),
            weights: histograms.fine().to_vec(),
        })
    }

    /// Returns the histograms, if `settings` ask for the same samples, in bins that are made of these.
    pub fn histograms(&self, settings: &SamplingSettings) -> Option<Histograms> {
        let own = &self.settings;
        let same = (settings.observers, settings.directions, settings.multisamples, settings.stop_transmittance)
            == (own.observers, own.directions, own.multisamples, own.stop_transmittance);
        let divides = |bins: usize| bins > 0 && own.fine_bins.is_multiple_of(bins);
        (same && divides(settings.fine_bins) && divides(settings.coarse_bins)).then(|| {
            let [fine, coarse] = [settings.fine_bins, settings.coarse_bins].map(|bins| self.bins(bins));
            Histograms { fine, coarse, samples: self.samples }
        })
    }

    fn bins(&self, per_channel: usize) -> Bins {
        let own = self.settings.fine_bins;
        let mut weights = vec![0.0; per_channel.pow(3)];
        for (bin, weight) in self.weights.iter().enumerate() {
            let [r, g, b] = [bin / (own * own), bin / own % own, bin % own].map(|place| place * per_channel / own);
            weights[(r * per_channel + g) * per_channel + b] += weight;
        }
        Bins { per_channel, weights }
    }
}

#[cfg(all(test, feature = "write"))]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::{
        bake::{BakeSettings, bake},
        sampling::{Progress, sample},
    };

    /// What is recorded is what is sampled, in as many bins as are asked for, but not for other observers.
    #[test]
    fn recorded_histograms_are_those_of_the_field() {
        let tint = |at: DVec3| move |direction: DVec3| 0.5 + 0.4 * at + 0.1 * direction;
        let field = bake(&BakeSettings { depth: 4, ..Default::default() }, |_| 3.0, tint).unwrap();
        let settings = SamplingSettings::default();
        let sampled = |settings: &SamplingSettings| sample(&field, settings, &Progress::default()).unwrap();
        let recorded = Recorded::new(&settings, &sampled(&settings)).unwrap();
        assert_eq!(recorded.histograms(&settings).unwrap().fine(), sampled(&settings).fine());
        for (fine_bins, coarse_bins) in [(32, 8), (16, 4), (8, 1)] {
            let settings = SamplingSettings { fine_bins, coarse_bins, ..settings.clone() };
            let (found, expected) = (recorded.histograms(&settings).unwrap(), sampled(&settings));
            assert_eq!(found.samples(), expected.samples());
            let pairs = found.fine().iter().zip(expected.fine()).chain(found.coarse().iter().zip(expected.coarse()));
            for (found, expected) in pairs {
                // Sums of the same numbers, in another order.
                assert!((found - expected).abs() <= 1e-13 * expected, "{found} {expected}");
            }
        }
        for other in [
            SamplingSettings { directions: 3, ..settings.clone() },
            SamplingSettings { fine_bins: 24, ..settings.clone() },
            SamplingSettings { stop_transmittance: 0.0, ..settings.clone() },
        ] {
            assert_eq!(recorded.histograms(&other), None);
        }
    }
}
