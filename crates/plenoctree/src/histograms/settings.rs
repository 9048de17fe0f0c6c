//! Settings of radiance sampling.

#[cfg(feature = "bevy")]
use bevy_reflect::std_traits::ReflectDefault;
use serde::{Deserialize, Serialize};

/// The directions from which a field is seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(
    feature = "bevy",
    derive(bevy_reflect::Reflect),
    reflect(Default, Clone, Debug, PartialEq, Hash),
    type_path = "plenoctree"
)]
pub enum ObserverRegion {
    /// From above the horizon, as in most training data: 4n x n direction cells. The default.
    #[default]
    UpperHemisphere,
    /// From all directions, for objects that are also seen from below: 4n x 2n direction cells.
    Sphere,
}

/// Settings of radiance sampling. The defaults are the paper's (section 3 of the method, steps 1 to 5).
///
/// There is no density threshold, because it is a setting of loading: leaves of a [`PlenOctree`](crate::PlenOctree) are
/// sampled however faint they are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[cfg_attr(
    feature = "bevy",
    derive(bevy_reflect::Reflect),
    reflect(Default, Clone, Debug, PartialEq),
    type_path = "plenoctree"
)]
pub struct SamplingSettings {
    /// Directions from which the field is seen. [`ObserverRegion::UpperHemisphere`] by default.
    pub observers: ObserverRegion,
    /// n: directions form a grid of 4n x n cells, or 4n x 2n for [`ObserverRegion::Sphere`]. 1 to 32, 2 by default.
    pub directions: usize,
    /// m: every direction cell is the mean of m x m rays. 1 to 16, 2 by default. All cells together may have at most
    /// [`Self::MAX_RAYS`] rays.
    pub multisamples: usize,
    /// Fraction of the leaves to sample, spread evenly over the field. Less is faster, but shifts the colors of hulls
    /// and fitted palettes. More than 0 and at most 1. `None`, the default, stands for 1, except that the extraction of
    /// tones does with less: see `ExtractionSettings::sampling_of`.
    pub sample_fraction: Option<f64>,
    /// Transmittance below which a leaf counts as hidden. At least 0 and less than 1, 1e-2 by default.
    pub stop_transmittance: f64,
    /// Bins per channel of the fine histogram, which k-means clusters. 1 to 64, 32 by default.
    pub fine_bins: usize,
    /// Bins per channel of the coarse histogram, which gives the initial centers of k-means. 1 to 16, 8 by default.
    pub coarse_bins: usize,
}

impl Default for SamplingSettings {
    fn default() -> Self {
        Self {
            observers: ObserverRegion::UpperHemisphere,
            directions: 2,
            multisamples: 2,
            sample_fraction: None,
            stop_transmittance: 1e-2,
            fine_bins: 32,
            coarse_bins: 8,
        }
    }
}

/// An error that occurs when a setting is out of range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("found {setting} = {}, expected {expected}", shortest(*.found))]
pub struct InvalidSetting {
    /// Name of the setting.
    pub setting: &'static str,
    /// Value of the setting.
    pub found: f64,
    /// Valid range, in words.
    pub expected: &'static str,
}

/// Returns the digits of a number, only those that it has in single precision if that is where it is from.
fn shortest(number: f64) -> String {
    let single = number as f32;
    if number.fract() != 0.0 && f64::from(single) == number { single.to_string() } else { number.to_string() }
}

impl InvalidSetting {
    /// Returns an error unless `holds`.
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
    /// Maximum number of rays from every leaf. The default settings make 64. Both the time and the memory that sampling
    /// takes grow with it.
    pub const MAX_RAYS: usize = 4096;

    /// Checks that every setting is in its range.
    ///
    /// # Errors
    ///
    /// Returns an error that names the first setting that is out of range.
    pub fn validate(&self) -> Result<(), InvalidSetting> {
        let count = |setting, found: usize, most: usize, expected| {
            InvalidSetting::check((1..=most).contains(&found), setting, found as f64, expected)
        };
        count("directions", self.directions, 32, "1 to 32")?;
        count("multisamples", self.multisamples, 16, "1 to 16")?;
        let rays = self.direction_cells() * self.multisamples.pow(2);
        let expected = "at most 4096, the number of direction cells times multisamples squared";
        count("rays", rays, Self::MAX_RAYS, expected)?;
        let fraction = self.sample_fraction.unwrap_or(1.0);
        let holds = fraction > 0.0 && fraction <= 1.0;
        InvalidSetting::check(holds, "sample_fraction", fraction, "more than 0 and at most 1")?;
        let stop = self.stop_transmittance;
        InvalidSetting::check((0.0..1.0).contains(&stop), "stop_transmittance", stop, "at least 0 and less than 1")?;
        count("fine_bins", self.fine_bins, 64, "1 to 64")?;
        count("coarse_bins", self.coarse_bins, 16, "1 to 16")
    }

    /// Returns the number of direction cells, which is the number of radiance samples per leaf.
    pub fn direction_cells(&self) -> usize {
        let rows = match self.observers {
            ObserverRegion::UpperHemisphere => self.directions,
            ObserverRegion::Sphere => 2 * self.directions,
        };
        4 * self.directions * rows
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_those_of_the_paper() {
        let settings = SamplingSettings::default();
        assert_eq!(settings.validate(), Ok(()));
        assert_eq!(settings.direction_cells(), 16);
        assert_eq!(serde_json::from_str::<SamplingSettings>("{}").unwrap(), settings);
    }

    #[test]
    fn errors_name_the_invalid_setting() {
        let default = SamplingSettings::default;
        for (settings, setting) in [
            (SamplingSettings { directions: 0, ..default() }, "directions"),
            (SamplingSettings { directions: 33, ..default() }, "directions"),
            (SamplingSettings { multisamples: 17, ..default() }, "multisamples"),
            (SamplingSettings { directions: 32, multisamples: 2, ..default() }, "rays"),
            (SamplingSettings { directions: 3, multisamples: 16, ..default() }, "rays"),
            (
                SamplingSettings { observers: ObserverRegion::Sphere, directions: 32, multisamples: 1, ..default() },
                "rays",
            ),
            (SamplingSettings { sample_fraction: Some(0.0), ..default() }, "sample_fraction"),
            (SamplingSettings { stop_transmittance: 1.0, ..default() }, "stop_transmittance"),
            (SamplingSettings { fine_bins: 0, ..default() }, "fine_bins"),
            (SamplingSettings { fine_bins: 65, ..default() }, "fine_bins"),
            (SamplingSettings { coarse_bins: 17, ..default() }, "coarse_bins"),
        ] {
            let error = settings.validate().unwrap_err();
            assert_eq!(error.setting, setting);
            assert!(error.to_string().starts_with(&format!("found {setting} = ")));
        }
        let most = SamplingSettings { directions: 2, multisamples: 16, fine_bins: 64, coarse_bins: 16, ..default() };
        assert_eq!(most.validate(), Ok(()));
        let most = SamplingSettings { directions: 32, multisamples: 1, ..default() };
        assert_eq!(most.validate(), Ok(()));
    }
}
