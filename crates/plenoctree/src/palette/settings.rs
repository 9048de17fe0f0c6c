//! Settings of palette extraction.

#[cfg(feature = "bevy")]
use bevy_reflect::std_traits::ReflectDefault;
use serde::{Deserialize, Serialize};

use super::{
    colors::Palette,
    method::{ColorCount, PaletteMethod},
};
use crate::{
    field::PlenOctree,
    sampling::{InvalidSetting, Progress, SamplingSettings, ViewRays},
};

/// Settings of palette extraction. The defaults are the paper's (section 3 of `docs/method.md`), except that
/// [`method`](Self::method) is [`PaletteMethod::Tones`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[cfg_attr(
    feature = "bevy",
    derive(bevy_reflect::Reflect),
    reflect(Default, Clone, Debug, PartialEq),
    type_path = "plenoctree"
)]
pub struct ExtractionSettings {
    /// Settings of radiance sampling.
    pub sampling: SamplingSettings,
    /// tau: share of the total weight above which a coarse bin is an initial center. At least 0 and less than 1, 8e-3
    /// by default. Of more than [`Self::MAX_CLUSTERS`] such bins, the heaviest are taken.
    pub coarse_threshold: f64,
    /// Maximum number of k-means iterations. 1 to 1000, 300 by default.
    pub max_iterations: usize,
    /// k-means stops when the summed squared shift of the centers is at most this factor times the variance of the
    /// bins. Finite and not negative, 1e-4 by default.
    pub tolerance: f64,
    /// How the palette is found. [`PaletteMethod::Tones`] by default.
    pub method: PaletteMethod,
    /// The number of colors. The usual number of the method by default.
    pub colors: ColorCount,
    /// d: number of steps from one palette color to another whose labels [`PaletteMethod::Fitted`] fits and
    /// [`ColorCount::Auto`] measures. 1 to 8, 3 by default. [`PaletteMethod::Tones`] has no blends, and ignores it.
    pub blend_steps: u32,
}

impl Default for ExtractionSettings {
    fn default() -> Self {
        Self {
            sampling: SamplingSettings::default(),
            coarse_threshold: 8e-3,
            max_iterations: 300,
            tolerance: 1e-4,
            method: PaletteMethod::default(),
            colors: ColorCount::default(),
            blend_steps: 3,
        }
    }
}

impl ExtractionSettings {
    /// Maximum number of clusters, whose convex hull takes seconds to simplify.
    pub const MAX_CLUSTERS: usize = 256;

    /// Returns the number of blend steps of the labels that are fitted and measured.
    pub(super) fn steps(&self) -> u32 {
        if self.method == PaletteMethod::Tones { 1 } else { self.blend_steps }
    }

    /// Creates the progress of an extraction with these settings. For tones, computing the palette counts as much as
    /// sampling; other palettes take so little time after sampling that it does not count.
    pub fn progress(&self) -> Progress {
        Progress::new(if self.method == PaletteMethod::Tones { 0.5 } else { 1.0 })
    }

    /// The number of leaves that are sampled at most where the palette does not depend on it: see
    /// [`sampling_of`](Self::sampling_of).
    pub const ENOUGH_LEAVES: usize = 1 << 14;

    /// Returns the settings of radiance sampling for a field. Tones are found in views, and histograms only say how far
    /// they are from the field's colors, unless a tolerance decides how many there are. So where
    /// [`SamplingSettings::sample_fraction`] is `None`, at most [`Self::ENOUGH_LEAVES`] leaves are sampled for tones.
    pub fn sampling_of(&self, field: &PlenOctree) -> SamplingSettings {
        let is_enough = self.method == PaletteMethod::Tones && !matches!(self.colors, ColorCount::Auto { .. });
        let enough = Self::ENOUGH_LEAVES as f64 / field.leaves().max(1) as f64;
        let fraction = self.sampling.sample_fraction.or((is_enough && enough < 1.0).then_some(enough));
        SamplingSettings { sample_fraction: fraction, ..self.sampling.clone() }
    }

    /// Returns the rays of the views that the method looks at, besides a field's histograms: none, unless it is
    /// [`PaletteMethod::Tones`].
    pub fn view_rays(&self, field: &PlenOctree) -> Vec<ViewRays> {
        if self.method == PaletteMethod::Tones { ViewRays::all(field, &self.sampling) } else { Vec::new() }
    }

    /// Checks that every setting is in its range.
    ///
    /// # Errors
    ///
    /// Returns an error that names the first setting that is out of range.
    pub fn validate(&self) -> Result<(), InvalidSetting> {
        self.sampling.validate()?;
        let (share, tolerance) = (self.coarse_threshold, self.tolerance);
        InvalidSetting::check((0.0..1.0).contains(&share), "coarse_threshold", share, "at least 0 and less than 1")?;
        let iterations = self.max_iterations;
        InvalidSetting::check((1..=1000).contains(&iterations), "max_iterations", iterations as f64, "1 to 1000")?;
        let holds = tolerance.is_finite() && tolerance >= 0.0;
        InvalidSetting::check(holds, "tolerance", tolerance, "a finite, non-negative number")?;
        let steps = self.blend_steps;
        InvalidSetting::check((1..=8).contains(&steps), "blend_steps", f64::from(steps), "1 to 8")?;
        match self.colors {
            ColorCount::Usual => Ok(()),
            ColorCount::Fixed(colors) => {
                let holds = (1..=Palette::MAX_COLORS).contains(&colors);
                InvalidSetting::check(holds, "colors", colors as f64, "1 to 64")
            }
            ColorCount::Auto { tolerance } => {
                let holds = tolerance > 0.0 && tolerance <= 1.0;
                InvalidSetting::check(holds, "colors.tolerance", tolerance, "more than 0 and at most 1")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::{
        bake::{BakeSettings, bake},
        field::Basis,
        palette::extract,
        sampling::SamplingPlan,
    };

    fn default<T: Default>() -> T {
        T::default()
    }

    #[test]
    fn defaults_are_those_of_the_paper() {
        let settings = ExtractionSettings::default();
        assert_eq!(settings.validate(), Ok(()));
        assert_eq!(serde_json::from_str::<ExtractionSettings>("{}").unwrap(), settings);
    }

    /// Only where histograms decide nothing are fewer leaves sampled, and the palette and its error stay the same.
    #[test]
    fn tones_of_large_fields_sample_enough_leaves() {
        let settings = BakeSettings { depth: 6, basis: Basis::Rgba, density_samples: 1, directions: 1, ..default() };
        let color =
            |at: DVec3| if at.x.sin() * (9.0 * at.y).sin() > 0.0 { DVec3::X } else { DVec3::new(0.1, 0.5, 0.8) };
        let field = bake(&settings, |at| if at.length() < 0.9 { 30.0 } else { 0.0 }, |at| move |_| color(at)).unwrap();
        let leaves = field.leaves();
        assert!(leaves > 2 * ExtractionSettings::ENOUGH_LEAVES, "{leaves}");
        let sampled = |settings: &ExtractionSettings| {
            SamplingPlan::new(&field, &settings.sampling_of(&field), &Progress::default()).unwrap().leaves.len()
        };
        let all = SamplingSettings { sample_fraction: Some(1.0), directions: 1, multisamples: 1, ..default() };
        let few = SamplingSettings { sample_fraction: None, ..all.clone() };
        let [tones, exact] = [few, all].map(|sampling| ExtractionSettings { sampling, ..default() });
        assert_eq!((sampled(&tones), sampled(&exact)), (ExtractionSettings::ENOUGH_LEAVES, leaves));
        for method in [PaletteMethod::Hull, PaletteMethod::Fitted] {
            assert_eq!(sampled(&ExtractionSettings { method, ..tones.clone() }), leaves);
        }
        assert_eq!(sampled(&ExtractionSettings { colors: ColorCount::AUTO, ..tones.clone() }), leaves);
        let [tones, exact] = [tones, exact].map(|settings| extract(&field, &settings, &Progress::default()).unwrap());
        assert_eq!(tones.palette, exact.palette);
        let ratio = tones.report.errors.rmse / exact.report.errors.rmse;
        assert!((0.97..1.03).contains(&ratio), "{ratio}");
    }

    #[test]
    fn errors_name_the_invalid_setting() {
        let default = ExtractionSettings::default;
        let sampling = SamplingSettings { directions: 0, ..Default::default() };
        for (settings, setting) in [
            (ExtractionSettings { sampling, ..default() }, "directions"),
            (ExtractionSettings { coarse_threshold: f64::NAN, ..default() }, "coarse_threshold"),
            (ExtractionSettings { max_iterations: 0, ..default() }, "max_iterations"),
            (ExtractionSettings { max_iterations: 1001, ..default() }, "max_iterations"),
            (ExtractionSettings { tolerance: -1.0, ..default() }, "tolerance"),
            (ExtractionSettings { colors: ColorCount::Fixed(65), ..default() }, "colors"),
            (ExtractionSettings { colors: ColorCount::Auto { tolerance: 0.0 }, ..default() }, "colors.tolerance"),
            (ExtractionSettings { blend_steps: 0, ..default() }, "blend_steps"),
        ] {
            let error = settings.validate().unwrap_err();
            assert_eq!(error.setting, setting);
            assert!(error.to_string().starts_with(&format!("found {setting} = ")));
        }
    }
}
