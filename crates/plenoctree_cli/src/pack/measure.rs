//! Compares views of a packed field with those of the field.

use std::{f64::consts::TAU, path::Path};

use glam::DVec3;
use plenoctree::{
    PlenOctree,
    camera::PinholeCamera,
    palette::{ExtractionSettings, LabelSpace, Palette, PaletteLabel},
    reference::{Posterization, Rendering, render},
};
use plenoctree_fit::decibels;

use super::ViewArguments;
use crate::{console, extraction, result::Result, transforms, turntable};

/// The size of views from around the field.
const SIZE: (u32, u32) = (200, 200);
/// Elevations of those views above the horizon, in radians.
const ELEVATIONS: [f64; 2] = [0.35, 0.9];

/// The number of views that [`psnr`] compares.
const COMPARED: u32 = 4;

/// Views of the field, and its palette if it has one.
pub struct Views {
    cameras: Vec<PinholeCamera>,
    expected: Vec<View>,
    palette: Option<Palette>,
}

/// The colors over white and the nearest labels of a view's pixels, without the filter. Pixels without one are thin.
struct View {
    colors: Vec<DVec3>,
    labels: Vec<Option<usize>>,
}

/// The loss from packing.
pub struct Loss {
    /// The PSNR of the packed field against the field, in decibels: the mean over the views.
    pub psnr: f64,
    /// The percentage of posterized pixels whose label changed. 0 if the field has no palette.
    pub labels: f64,
}

impl Views {
    /// Renders the field of a file. Returns `None` if nothing is to be measured. Warns if the field has no palette: its
    /// labels cannot be compared.
    pub fn new(field: &PlenOctree, path: &Path, arguments: &ViewArguments) -> Result<Option<Self>> {
        let cameras = match &arguments.cameras {
            Some(file) => transforms::read(file, arguments.size)?.cameras,
            None => around(field, arguments.size.unwrap_or(SIZE), arguments.views),
        };
        let views = cameras.len().min(arguments.views as usize);
        let cameras: Vec<_> = (0..views).map(|view| cameras[view * cameras.len() / views]).collect();
        if cameras.is_empty() {
            return Ok(None);
        }
        let palette = palette(field)
            .inspect_err(|error| console::complain!("warning: {}: measured without labels: {error}", path.display()))
            .ok();
        let expected = cameras.iter().map(|camera| View::new(field, camera, palette.as_ref())).collect();
        Ok(Some(Self { cameras, expected, palette }))
    }

    /// Returns their number.
    pub fn count(&self) -> usize {
        self.cameras.len()
    }

    /// Returns the palette of the field.
    pub fn palette(&self) -> Option<&Palette> {
        self.palette.as_ref()
    }

    /// Compares the packed field with the field.
    pub fn compare(&self, packed: &PlenOctree) -> Loss {
        let (mut psnr, mut changed, mut posterized) = (0.0, 0, 0);
        for (camera, expected) in self.cameras.iter().zip(&self.expected) {
            let found = View::new(packed, camera, self.palette());
            psnr += difference(&found.colors, &expected.colors);
            for (found, expected) in found.labels.iter().zip(&expected.labels) {
                posterized += usize::from(expected.is_some());
                changed += usize::from(expected.is_some() && found != expected);
            }
        }
        let labels = 100.0 * changed as f64 / posterized.max(1) as f64;
        Loss { psnr: psnr / self.count() as f64, labels }
    }
}

impl View {
    fn new(field: &PlenOctree, camera: &PinholeCamera, palette: Option<&Palette>) -> Self {
        let settings = Posterization::default();
        let rendering = render(field, camera);
        let colors = colors(&rendering);
        // Tones are labels of the field alone, and have no blends.
        let nearest = |pixel: usize| {
            let palette = palette?;
            match palette.label_space() {
                LabelSpace::Encoded => PaletteLabel::nearest(colors[pixel], palette, settings.blend_steps),
                LabelSpace::Tones => {
                    PaletteLabel::nearest(rendering.color[pixel] / rendering.opacity[pixel].max(1e-6), palette, 1)
                }
            }
        };
        let is_labeled = |pixel: &usize| rendering.opacity[*pixel] >= settings.min_opacity;
        let label = |pixel| Some(pixel).filter(is_labeled).and_then(nearest).map(|label| label.index);
        Self { labels: (0..colors.len()).map(label).collect(), colors }
    }
}

/// Returns the PSNR of a packed field against the field, in decibels: the mean over a few views from around, over white.
/// `None` if nothing is visible.
pub fn psnr(field: &PlenOctree, packed: &PlenOctree) -> Option<f64> {
    let of_view = |camera: &PinholeCamera| {
        let [found, expected] = [packed, field].map(|field| colors(&render(field, camera)));
        difference(&found, &expected)
    };
    let psnrs: Vec<f64> = around(field, SIZE, COMPARED).iter().map(of_view).collect();
    (!psnrs.is_empty()).then(|| psnrs.iter().sum::<f64>() / psnrs.len() as f64)
}

/// Returns the colors of a view over white.
fn colors(rendering: &Rendering) -> Vec<DVec3> {
    rendering.over(DVec3::ONE).into_iter().map(|color| color.clamp(DVec3::ZERO, DVec3::ONE)).collect()
}

/// Returns the PSNR of colors, in decibels.
fn difference(found: &[DVec3], expected: &[DVec3]) -> f64 {
    let squares: f64 = found.iter().zip(expected).map(|(found, expected)| found.distance_squared(*expected)).sum();
    decibels(squares / (3.0 * found.len() as f64))
}

/// Returns views from around, half of them from higher up. No views if the field is empty.
fn around(field: &PlenOctree, size: (u32, u32), views: u32) -> Vec<PinholeCamera> {
    let of_view = |view: u32| {
        let azimuth = TAU * f64::from(view) / f64::from(views);
        turntable::around(field, size, [azimuth].into_iter(), ELEVATIONS[view as usize % 2])
    };
    (0..views).filter_map(of_view).flatten().collect()
}

/// Extracts the palette of a field.
pub fn palette(field: &PlenOctree) -> Result<Palette> {
    Ok(extraction::cpu::extract(field, &ExtractionSettings::default(), true)?.extraction.palette)
}
