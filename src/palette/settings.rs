//! What can be chosen about extraction.

use serde::{Deserialize, Serialize};

use super::Palette;

/// From where the field is looked at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Observers {
    /// From above the horizon, as most fields are trained: 4n x n cells of directions.
    #[default]
    UpperHemisphere,
    /// From everywhere, for objects that are also seen from below: 4n x 2n cells of directions.
    Sphere,
}

/// How a palette is extracted; the default is the paper's choice (section 3 of the method).
///
/// The density under which a cell is empty is not among them: it is a property of loading, and every leaf that a
/// [`PlenOctree`](crate::field::PlenOctree) holds counts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ExtractionSettings {
    /// From where the field is looked at.
    pub observers: Observers,
    /// n: directions are on a grid of 4n x n cells. 1 to 64, 2 by default.
    pub directions: usize,
    /// Each cell of directions is the mean of this many squared. 1 to 16, 2 by default.
    pub multisamples: usize,
    /// The share of the leaves that is sampled, evenly over the field: 1 for all, less for speed. Above 0 to 1, 1 by
    /// default.
    pub sample_fraction: f64,
    /// Transmittance under which a leaf counts as hidden. 0 to below 1, 1e-2 by default.
    pub stop_transmittance: f64,
    /// Bins a channel of the histogram that is clustered. 1 to 128, 32 by default.
    pub fine_bins: usize,
    /// Bins a channel of the histogram that gives the initial centers. 1 to 32, 8 by default.
    pub coarse_bins: usize,
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
            observers: Observers::UpperHemisphere,
            directions: 2,
            multisamples: 2,
            sample_fraction: 1.0,
            stop_transmittance: 1e-2,
            fine_bins: 32,
            coarse_bins: 8,
            coarse_threshold: 8e-3,
            max_iterations: 300,
            tolerance: 1e-4,
            colors: 6,
        }
    }
}

/// A setting out of its range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("found {setting} = {found}, expected {expected}")]
pub struct InvalidSetting {
    /// The name of the field.
    pub setting: &'static str,
    /// Its value.
    pub found: f64,
    /// Its range, in words.
    pub expected: &'static str,
}

impl ExtractionSettings {
    /// Whether every setting is in its range.
    pub fn validate(&self) -> Result<(), InvalidSetting> {
        let check = |holds: bool, setting, found: f64, expected| {
            if holds { Ok(()) } else { Err(InvalidSetting { setting, found, expected }) }
        };
        let count = |setting, found: usize, most: usize, expected| {
            check((1..=most).contains(&found), setting, found as f64, expected)
        };
        let share = |setting, found: f64| check((0.0..1.0).contains(&found), setting, found, "0 to below 1");
        count("directions", self.directions, 64, "1 to 64")?;
        count("multisamples", self.multisamples, 16, "1 to 16")?;
        let fraction = self.sample_fraction;
        check(fraction > 0.0 && fraction <= 1.0, "sample_fraction", fraction, "above 0 to 1")?;
        share("stop_transmittance", self.stop_transmittance)?;
        count("fine_bins", self.fine_bins, 128, "1 to 128")?;
        count("coarse_bins", self.coarse_bins, 32, "1 to 32")?;
        share("coarse_threshold", self.coarse_threshold)?;
        count("max_iterations", self.max_iterations, usize::MAX, "at least 1")?;
        let tolerance = self.tolerance;
        check(tolerance.is_finite() && tolerance >= 0.0, "tolerance", tolerance, "a number that is not negative")?;
        count("colors", self.colors, Palette::MAX_COLORS, "1 to 64")
    }

    /// Cells of directions: radiance samples a leaf.
    pub fn direction_cells(&self) -> usize {
        let rows = match self.observers {
            Observers::UpperHemisphere => self.directions,
            Observers::Sphere => 2 * self.directions,
        };
        4 * self.directions * rows
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_is_the_papers() {
        let settings = ExtractionSettings::default();
        assert_eq!(settings.validate(), Ok(()));
        assert_eq!(settings.direction_cells(), 16);
        assert_eq!(serde_json::from_str::<ExtractionSettings>("{}").unwrap(), settings);
    }

    #[test]
    fn nonsense_is_named() {
        let default = ExtractionSettings::default;
        for (settings, setting) in [
            (ExtractionSettings { directions: 0, ..default() }, "directions"),
            (ExtractionSettings { multisamples: 17, ..default() }, "multisamples"),
            (ExtractionSettings { sample_fraction: 0.0, ..default() }, "sample_fraction"),
            (ExtractionSettings { stop_transmittance: 1.0, ..default() }, "stop_transmittance"),
            (ExtractionSettings { fine_bins: 0, ..default() }, "fine_bins"),
            (ExtractionSettings { coarse_bins: 1000, ..default() }, "coarse_bins"),
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
