//! Measures how much a field looks like its capture.

use std::fmt;

use glam::DVec3;
use plenoctree::{PlenOctree, camera::PinholeCamera, reference::render};
use plenoctree_fit::{Comparison, Shot, decibels, splat::SplatImage};
use serde_json::{Value, json};

/// The backgrounds of both.
const BACKGROUNDS: [(&str, DVec3); 2] = [("white", DVec3::ONE), ("black", DVec3::ZERO)];
/// Opacity below which a pixel shows nothing.
const CLEAR: f64 = 0.01;

/// The capture as cameras see it that no field is refined with.
pub struct Standard {
    /// From where the whole is in view.
    pub whole: Pictures,
    /// From halfway in between, as a multiple.
    pub between: Pictures,
    /// From nearby.
    pub near: Pictures,
}

/// Pictures of the capture, and the cameras that took them.
pub struct Pictures {
    pub cameras: Vec<PinholeCamera>,
    pub images: Vec<SplatImage>,
}

/// Views of a field next to those of its capture.
pub struct Measured {
    pub whole: Compared,
    between: Compared,
    near: Compared,
}

/// Views of a field next to pictures of its capture.
pub struct Compared {
    /// Mean PSNR over white, and over black, in decibels.
    pub psnr: [f64; 2],
    /// PSNR of every view over white, and over black.
    views: Vec<[f64; 2]>,
    /// Where they show something.
    pub shown: Shown,
    /// The capture at the left, the field at the right, over white.
    pub previews: Vec<Comparison>,
}

/// The pixels of all views in which the capture or the field shows something. Small things far apart leave most of a
/// view empty, which raises its PSNR, however little the field looks like them.
#[derive(Clone, Copy)]
pub struct Shown {
    /// Their share of all pixels.
    pub share: f64,
    /// PSNR over white and black together, in decibels, or 0 if there are none.
    pub psnr: f64,
}

impl Standard {
    /// Compares a field with the capture.
    pub fn measure(&self, field: &PlenOctree) -> Measured {
        let [whole, between, near] = [&self.whole, &self.between, &self.near].map(|pictures| pictures.compare(field));
        Measured { whole, between, near }
    }
}

impl Pictures {
    /// Returns the pictures, to measure rounds of refining by.
    pub fn shots(&self) -> Vec<Shot> {
        let both = self.cameras.iter().zip(&self.images);
        both.map(|(camera, image)| Shot::new(camera, &image.pixels)).collect()
    }

    /// Renders the field in float64, with one ray through the center of each pixel, and compares.
    pub fn compare(&self, field: &PlenOctree) -> Compared {
        let (mut views, mut previews) = (Vec::new(), Vec::new());
        let (mut shown_squared, mut shown_count, mut count) = (0.0, 0.0, 0.0);
        for (index, (camera, image)) in self.cameras.iter().zip(&self.images).enumerate() {
            let rendering = render(field, camera);
            let opacities = image.pixels.iter().zip(&rendering.opacity);
            let is_shown: Vec<bool> = opacities.map(|(a, b)| f64::from(a.w).max(*b) >= CLEAR).collect();
            shown_count += is_shown.iter().filter(|shown| **shown).count() as f64;
            count += is_shown.len() as f64;
            let mut pictures = Vec::new();
            let psnr = BACKGROUNDS.map(|(_, background)| {
                let (splat, field) = (image.over(background), rendering.over(background));
                let squared: Vec<f64> = splat.iter().zip(&field).map(|(a, b)| a.distance_squared(*b)).collect();
                let shown = squared.iter().zip(&is_shown).filter(|(_, shown)| **shown);
                shown_squared += shown.map(|(squared, _)| squared).sum::<f64>();
                pictures.push((splat, field));
                decibels(squared.iter().sum::<f64>() / (3.0 * rendering.color.len() as f64))
            });
            views.push(psnr);
            let (splat, field) = pictures.swap_remove(0);
            let bytes =
                |colors: Vec<DVec3>| colors.into_iter().map(|color| crate::hex::quantize(color.to_array())).collect();
            previews.push(Comparison {
                name: format!("{index:02}"),
                width: camera.width,
                height: camera.height,
                photographed: bytes(splat),
                rendered: bytes(field),
            });
        }
        let mean = |side: usize| views.iter().map(|psnr| psnr[side]).sum::<f64>() / views.len().max(1) as f64;
        let shown = Shown {
            share: shown_count / f64::max(count, 1.0),
            psnr: if shown_count > 0.0 { decibels(shown_squared / (6.0 * shown_count)) } else { 0.0 },
        };
        Compared { psnr: [mean(0), mean(1)], views, shown, previews }
    }
}

impl Measured {
    /// Returns the measurements for the report.
    pub fn json(&self, field: &PlenOctree) -> Value {
        let object = |psnr: &[f64; 2]| json!({BACKGROUNDS[0].0: psnr[0], BACKGROUNDS[1].0: psnr[1]});
        json!({
            "leaves": field.leaves(),
            "psnr_db": object(&self.whole.psnr),
            "between_psnr_db": object(&self.between.psnr),
            "near_psnr_db": object(&self.near.psnr),
            "shown": {"share": self.whole.shown.share, "psnr_db": self.whole.shown.psnr},
            "views": self.whole.views.iter().map(object).collect::<Vec<_>>(),
        })
    }

    /// Returns what this field gains over another one at each distance, in the mean PSNR over white, in decibels: from
    /// where the whole is in view, from halfway and from nearby.
    pub fn gains(&self, before: &Self) -> [f64; 3] {
        let psnrs = |measured: &Self| [&measured.whole, &measured.between, &measured.near].map(|views| views.psnr[0]);
        let (before, after) = (psnrs(before), psnrs(self));
        std::array::from_fn(|distance| after[distance] - before[distance])
    }
}

impl fmt::Display for Measured {
    /// Describes how much the field looks like its capture, over white and over black.
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let [[whole, black], [between, between_black], [near, near_black]] =
            [&self.whole, &self.between, &self.near].map(|compared| compared.psnr);
        write!(f, "{whole:.2} dB over white and {black:.2} dB over black, ")?;
        write!(f, "from halfway {between:.2} dB and {between_black:.2} dB, ")?;
        write!(f, "from nearby {near:.2} dB and {near_black:.2} dB")
    }
}
