//! The settings to measure, and their values.

use bevy_plenoctree::PropQuality;
use plenoctree::{
    palette::{ExtractionSettings, PaletteMethod},
    sampling::SamplingSettings,
};

/// One value of one setting, or a preset.
#[derive(Clone)]
pub struct Variant {
    /// The setting that is not exact.
    pub setting: &'static str,
    /// Its value.
    pub value: String,
    /// The quality of the camera.
    pub quality: PropQuality,
}

/// Returns the variants of rendering, the exact one first.
pub fn rendering() -> Vec<Variant> {
    let variant = |setting, value: String, quality| Variant { setting, value, quality };
    let mut all = vec![variant("exact", String::new(), PropQuality::EXACT)];
    let mut knob = |setting, values: &[f32], turn: fn(&mut PropQuality, f32)| {
        for value in values {
            let mut quality = PropQuality::EXACT;
            turn(&mut quality, *value);
            all.push(variant(setting, value.to_string(), quality));
        }
    };
    knob("stop_transmittance", &[0.02, 0.05, 0.1], |quality, value| quality.stop_transmittance = value);
    knob("density_threshold", &[0.5, 2.0, 8.0], |quality, value| quality.density_threshold = value);
    knob("opacity_loss", &[0.002, 0.01, 0.02, 0.05], |quality, value| quality.opacity_loss = value);
    knob("cell_size", &[0.7, 1.0, 1.5, 2.0, 3.0], |quality, value| quality.cell_size = value);
    knob("ray_tolerance", &[0.03, 0.06, 0.1, 0.2, 0.4, 1.0], |quality, value| quality.ray_tolerance = value);
    knob("edge_rays", &[4.0], |quality, value| quality.edge_rays = value as u32);
    knob("estimates_edges", &[1.0], |quality, value| quality.estimates_edges = value > 0.0);
    knob("filter_iterations", &[3.0, 2.0, 1.0, 0.0], |quality, value| quality.filter_iterations = value as u32);
    all.extend(PropQuality::PRESETS[1..].iter().map(|(name, quality)| variant("preset", (*name).into(), *quality)));
    all
}

/// Returns the variants of extraction, the exact one first.
pub fn extraction() -> Vec<(&'static str, String, ExtractionSettings)> {
    let settings =
        |sampling| ExtractionSettings { sampling, method: PaletteMethod::Fitted, ..ExtractionSettings::default() };
    let exact = SamplingSettings::default();
    let mut all = vec![("extraction", "exact".into(), settings(exact.clone()))];
    for fraction in [0.5, 0.25, 0.1] {
        let sampling = SamplingSettings { sample_fraction: Some(fraction), ..exact.clone() };
        all.push(("sample_fraction", fraction.to_string(), settings(sampling)));
    }
    all.push(("directions", "1".into(), settings(SamplingSettings { directions: 1, ..exact.clone() })));
    all.push(("multisamples", "1".into(), settings(SamplingSettings { multisamples: 1, ..exact })));
    all
}
