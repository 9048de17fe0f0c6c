//! Settings of radiance sampling.

#[cfg(feature = "bevy")]
use bevy_reflect::std_traits::ReflectDefault;
use serde::{Deserialize, Serialize};

/// From where the field is looked at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(
    feature = "bevy",
    derive(bevy_reflect::Reflect),
    reflect(Default, Clone, Debug, PartialEq, Hash),
    type_path = "plenoctree"
)]
pub enum Observers {
    /// From above the horizon, as most fields are trained: 4n x n cells of directions.
    #[default]
    UpperHemisphere,
    /// From everywhere, for objects that are also seen from below: 4n x 2n cells of directions.
    Sphere,
}

/// How the radiance of a field is sampled; the default is the paper's choice (section 3 of the method, steps 1 to 5).
///
/// The density under which a cell is empty is not among them: it is a property of loading, and every leaf that a
/// [`PlenOctree`](crate::PlenOctree) holds counts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[cfg_attr(
    feature = "bevy",
    derive(bevy_reflect::Reflect),
    reflect(Default, Clone, Debug, PartialEq),
    type_path = "plenoctree"
)]
pub struct SamplingSettings {
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
}

impl Default for SamplingSettings {
    fn default() -> Self {
        Self {
            observers: Observers::UpperHemisphere,
            directions: 2,
            multisamples: 2,
            sample_fraction: 1.0,
            stop_transmittance: 1e-2,
            fine_bins: 32,
            coarse_bins: 8,
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

impl InvalidSetting {
    /// An error unless `holds`.
    pub(crate) fn check(
        holds: bool,
        setting: &'static str,
        found: f64,
        expected: &'static str,
    ) -> Result<(), InvalidSetting> {
        if holds { Ok(()) } else { Err(Self { setting, found, expected }) }
    }
}

impl SamplingSettings {
    /// Whether every setting is in its range.
    pub fn validate(&self) -> Result<(), InvalidSetting> {
        let count = |setting, found: usize, most: usize, expected| {
            InvalidSetting::check((1..=most).contains(&found), setting, found as f64, expected)
        };
        count("directions", self.directions, 64, "1 to 64")?;
        count("multisamples", self.multisamples, 16, "1 to 16")?;
        let fraction = self.sample_fraction;
        InvalidSetting::check(fraction > 0.0 && fraction <= 1.0, "sample_fraction", fraction, "above 0 to 1")?;
        let stop = self.stop_transmittance;
        InvalidSetting::check((0.0..1.0).contains(&stop), "stop_transmittance", stop, "0 to below 1")?;
        count("fine_bins", self.fine_bins, 128, "1 to 128")?;
        count("coarse_bins", self.coarse_bins, 32, "1 to 32")
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
        let settings = SamplingSettings::default();
        assert_eq!(settings.validate(), Ok(()));
        assert_eq!(settings.direction_cells(), 16);
        assert_eq!(serde_json::from_str::<SamplingSettings>("{}").unwrap(), settings);
    }

    #[test]
    fn nonsense_is_named() {
        let default = SamplingSettings::default;
        for (settings, setting) in [
            (SamplingSettings { directions: 0, ..default() }, "directions"),
            (SamplingSettings { multisamples: 17, ..default() }, "multisamples"),
            (SamplingSettings { sample_fraction: 0.0, ..default() }, "sample_fraction"),
            (SamplingSettings { stop_transmittance: 1.0, ..default() }, "stop_transmittance"),
            (SamplingSettings { fine_bins: 0, ..default() }, "fine_bins"),
            (SamplingSettings { coarse_bins: 1000, ..default() }, "coarse_bins"),
        ] {
            let error = settings.validate().unwrap_err();
            assert_eq!(error.setting, setting);
            assert!(error.to_string().starts_with(&format!("found {setting} = ")));
        }
    }
}
