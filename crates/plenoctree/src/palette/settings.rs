//! Settings of palette extraction.

#[cfg(feature = "bevy")]
use bevy_reflect::std_traits::ReflectDefault;
use serde::{Deserialize, Serialize};

use super::colors::Palette;
use crate::sampling::{InvalidSetting, SamplingSettings};

/// How a palette is extracted; the default is the paper's choice (section 3 of the method).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[cfg_attr(
    feature = "bevy",
    derive(bevy_reflect::Reflect),
    reflect(Default, Clone, Debug, PartialEq),
    type_path = "plenoctree"
)]
pub struct ExtractionSettings {
    /// How the field's radiance is sampled.
    pub sampling: SamplingSettings,
    /// tau, the share of the weight above which a coarse bin is an initial center. 0 to below 1, 8e-3 by default.
    pub coarse_threshold: f64,
    /// Rounds of k-means at most. At least 1, 300 by default.
    pub max_iterations: usize,
    /// k-means ends when the summed squared shift of the centers is at most this times the variance of the bins. Not
    /// negative, 1e-4 by default.
    pub tolerance: f64,
    /// Colors wanted, 1 to 64, 6 by default. A cloud of colors with a volume has at least four corners, so that four
    /// is the least it can give.
    pub colors: usize,
}

impl Default for ExtractionSettings {
    fn default() -> Self {
        Self {
            sampling: SamplingSettings::default(),
            coarse_threshold: 8e-3,
            max_iterations: 300,
            tolerance: 1e-4,
            colors: 6,
        }
    }
}

impl ExtractionSettings {
    /// Whether every setting is in its range.
    pub fn validate(&self) -> Result<(), InvalidSetting> {
        self.sampling.validate()?;
        let (share, tolerance) = (self.coarse_threshold, self.tolerance);
        InvalidSetting::check((0.0..1.0).contains(&share), "coarse_threshold", share, "0 to below 1")?;
        let iterations = self.max_iterations;
        InvalidSetting::check(iterations >= 1, "max_iterations", iterations as f64, "at least 1")?;
        let holds = tolerance.is_finite() && tolerance >= 0.0;
        InvalidSetting::check(holds, "tolerance", tolerance, "a number that is not negative")?;
        let colors = self.colors;
        InvalidSetting::check((1..=Palette::MAX_COLORS).contains(&colors), "colors", colors as f64, "1 to 64")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_is_the_papers() {
        let settings = ExtractionSettings::default();
        assert_eq!(settings.validate(), Ok(()));
        assert_eq!(serde_json::from_str::<ExtractionSettings>("{}").unwrap(), settings);
    }

    #[test]
    fn nonsense_is_named() {
        let default = ExtractionSettings::default;
        let sampling = SamplingSettings { directions: 0, ..Default::default() };
        for (settings, setting) in [
            (ExtractionSettings { sampling, ..default() }, "directions"),
            (ExtractionSettings { coarse_threshold: f64::NAN, ..default() }, "coarse_threshold"),
            (ExtractionSettings { max_iterations: 0, ..default() }, "max_iterations"),
            (ExtractionSettings { tolerance: -1.0, ..default() }, "tolerance"),
            (ExtractionSettings { colors: 65, ..default() }, "colors"),
        ] {
            let error = settings.validate().unwrap_err();
            assert_eq!(error.setting, setting);
            assert!(error.to_string().starts_with(&format!("found {setting} = ")));
        }
    }
}
