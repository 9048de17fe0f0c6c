//! Measures how much a field looks like its capture.

use glam::DVec3;
use plenoctree::{PlenOctree, camera::PinholeCamera, reference::render};
use plenoctree_fit::{Comparison, splat::SplatImage};
use serde_json::{Value, json};

/// The backgrounds of both.
const BACKGROUNDS: [(&str, DVec3); 2] = [("white", DVec3::ONE), ("black", DVec3::ZERO)];

/// Views of a field next to those of its capture.
pub struct Measured {
    /// Mean PSNR over white, and over black, in decibels.
    pub psnr: [f64; 2],
    /// PSNR of every view over white, and over black.
    views: Vec<[f64; 2]>,
    /// The capture at the left, the field at the right, over white.
    pub previews: Vec<Comparison>,
}

/// Renders the field in float64, with one ray through the center of each pixel, and compares.
pub fn measure(field: &PlenOctree, cameras: &[PinholeCamera], images: &[SplatImage]) -> Measured {
    let (mut views, mut previews) = (Vec::new(), Vec::new());
    for (index, (camera, image)) in cameras.iter().zip(images).enumerate() {
        let rendering = render(field, camera);
        let mut pictures = Vec::new();
        let psnr = BACKGROUNDS.map(|(_, background)| {
            let (splat, field) = (image.over(background), rendering.over(background));
            let squared: f64 = splat.iter().zip(&field).map(|(a, b)| a.distance_squared(*b)).sum();
            pictures.push((splat, field));
            -10.0 * (squared / (3.0 * rendering.color.len() as f64)).max(1e-10).log10()
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
            psnr: psnr[0],
            ..Comparison::default()
        });
    }
    let mean = |side: usize| views.iter().map(|psnr| psnr[side]).sum::<f64>() / views.len().max(1) as f64;
    Measured { psnr: [mean(0), mean(1)], views, previews }
}

impl Measured {
    /// Returns the measurements for the report: these, and those from nearby.
    pub fn json(&self, field: &PlenOctree, near: &Self) -> Value {
        let object = |psnr: &[f64; 2]| json!({BACKGROUNDS[0].0: psnr[0], BACKGROUNDS[1].0: psnr[1]});
        json!({
            "leaves": field.leaves(),
            "psnr_db": object(&self.psnr),
            "near_psnr_db": object(&near.psnr),
            "views": self.views.iter().map(object).collect::<Vec<_>>(),
        })
    }
}
