//! The palette and the settings of its extraction for inspectors and scenes. They themselves know nothing of Bevy; a field
//! that is missing here does not compile.

use bevy::reflect::{impl_reflect, std_traits::ReflectDefault};

use crate::palette::{ExtractionSettings, Observers, Palette};

impl_reflect!(
    #[reflect(Clone, Debug, PartialEq)]
    #[type_path = "bevy_plenoctree::palette"]
    struct Palette {
        colors: Vec<[f64; 3]>,
        weights: Vec<f64>,
    }
);

impl_reflect!(
    #[reflect(Clone, Debug, PartialEq, Hash, Default)]
    #[type_path = "bevy_plenoctree::palette"]
    enum Observers {
        UpperHemisphere,
        Sphere,
    }
);

impl_reflect!(
    #[reflect(Clone, Debug, PartialEq)]
    #[type_path = "bevy_plenoctree::palette"]
    struct ExtractionSettings {
        observers: Observers,
        directions: usize,
        multisamples: usize,
        sample_fraction: f64,
        stop_transmittance: f64,
        fine_bins: usize,
        coarse_bins: usize,
        coarse_threshold: f64,
        max_iterations: usize,
        tolerance: f64,
        colors: usize,
    }
);
