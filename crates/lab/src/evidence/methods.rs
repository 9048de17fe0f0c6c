//! The palettes that the report compares.

use image::RgbaImage;
use plenoctree::{
    PlenOctree,
    palette::{Extraction, ExtractionSettings, Palette, initial_centers},
    sampling::Histograms,
};
use plenoctree_cli::{progress, result::Result};

use super::baselines::{self, RawSamples, WeightedColors};
use crate::coherence::object_pixels;

/// A way to find a palette.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// The paper's: visibility, k-means and the hull.
    Hull,
    /// Fitted to its own labels.
    Fitted,
    /// Mean shift in place of k-means, then the hull.
    MeanShift,
    /// Chao et al. 2021, from one view.
    OneView,
    /// Chao et al. 2021, from seven views.
    SevenViews,
    /// Tan et al. 2016, from raw samples.
    Tan,
    /// Wang et al. 2019, from raw samples.
    Wang,
    /// The paper's k-means and hull, from raw samples.
    Unweighted,
}

impl Method {
    /// All methods. The field's own come first.
    pub const ALL: [Self; 8] = [
        Self::Hull,
        Self::Fitted,
        Self::MeanShift,
        Self::OneView,
        Self::SevenViews,
        Self::Tan,
        Self::Wang,
        Self::Unweighted,
    ];

    /// Returns the name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hull => "hull",
            Self::Fitted => "fitted",
            Self::MeanShift => "mean_shift",
            Self::OneView => "one_view",
            Self::SevenViews => "seven_views",
            Self::Tan => "tan_raw",
            Self::Wang => "wang_raw",
            Self::Unweighted => "k_means_raw",
        }
    }

    /// Returns the name for readers.
    pub fn label(self) -> &'static str {
        match self {
            Self::Hull => "field, hull (the paper)",
            Self::Fitted => "field, fitted",
            Self::MeanShift => "field, mean shift and hull",
            Self::OneView => "one view (Chao 2021)",
            Self::SevenViews => "seven views (Chao 2021)",
            Self::Tan => "raw samples (Tan 2016)",
            Self::Wang => "raw samples (Wang 2019)",
            Self::Unweighted => "raw samples, k-means without visibility",
        }
    }
}

/// Palettes of all methods, and details of how they were found.
pub struct Methods {
    palettes: Vec<Palette>,
    /// The raw samples.
    pub raw: RawSamples,
    /// The number of modes that mean shift found.
    pub modes: usize,
    /// The loss of Wang et al. before and after their optimization.
    pub losses: [f64; 2],
}

impl Methods {
    /// Finds all palettes. `examples` are the example views as trained.
    pub fn find(
        field: &PlenOctree,
        settings: &ExtractionSettings,
        histograms: &Histograms,
        [hull, fitted]: [&Extraction; 2],
        examples: &[RgbaImage],
        colors: usize,
        quiet: bool,
    ) -> Result<Self> {
        let bar = progress::bar("palettes", 6, quiet);
        let step = || bar.inc(1);
        let raw = RawSamples::draw(field, &settings.sampling).ok_or("the field has no leaves")?;
        step();
        let threshold = settings.coarse_threshold;
        let (mean_shift, modes) = baselines::mean_shift(histograms, threshold, colors)?;
        step();
        let pixels: Vec<Vec<[f64; 3]>> = examples.iter().map(object_pixels).collect();
        // The view with the most pixels is the one that an author would choose.
        let largest = pixels.iter().max_by_key(|pixels| pixels.len()).filter(|pixels| !pixels.is_empty());
        let largest = largest.ok_or("no pixel of the example views is opaque enough to be posterized")?;
        let one_view = baselines::chao(&WeightedColors::new(largest), colors)?;
        let seven_views = baselines::chao(&WeightedColors::new(&pixels.concat()), colors)?;
        step();
        let tan = baselines::tan(&raw.colors, colors)?;
        step();
        let wang = baselines::wang(&raw.colors, colors)?;
        step();
        let centers = initial_centers(histograms, settings);
        let unweighted = baselines::clustered(&raw.colors, &centers, colors)?;
        bar.finish_and_clear();

        let [hull, fitted] = [hull, fitted].map(|extraction| extraction.palette.clone());
        let losses = [wang.losses[0], wang.losses[wang.losses.len() - 1]];
        let palettes = vec![hull, fitted, mean_shift, one_view, seven_views, tan, wang.palette, unweighted];
        Ok(Self { palettes, raw, modes, losses })
    }

    /// Returns the palette of a method.
    pub fn palette(&self, method: Method) -> &Palette {
        &self.palettes[method as usize]
    }
}
