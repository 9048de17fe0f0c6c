//! The radiance samples that a palette was extracted from.

use std::{fmt, sync::Arc};

use bevy::prelude::*;
use plenoctree::sampling::Histograms;

/// The samples that a palette was extracted from.
#[derive(Clone, Debug)]
pub struct ExtractionSamples {
    /// The histograms of all radiance samples, weighted by visibility.
    pub histograms: Arc<Histograms>,
    /// Where the samples were taken.
    pub origin: SampleOrigin,
}

/// Where radiance samples were taken. [`Display`](fmt::Display) says it in words, such as "on the GPU".
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Reflect)]
#[reflect(Clone, Debug, PartialEq, Hash)]
#[type_path = "bevy_plenoctree"]
pub enum SampleOrigin {
    /// In compute shaders, in the render world.
    Gpu,
    /// On background threads.
    Cpu,
    /// Before the field was packed: its file [records](plenoctree::PlenOctree::histograms) their histograms. For tones,
    /// background threads also cast rays through the packed field.
    Recorded,
}

impl fmt::Display for SampleOrigin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Gpu => "on the GPU",
            Self::Cpu => "on the CPU",
            Self::Recorded => "before the field was packed",
        })
    }
}
