//! Renders with the float64 reference, on the CPU.

use std::time::Instant;

use glam::DVec3;
use image::RgbImage;
use plenoctree::{
    camera::PinholeCamera,
    reference::{Posterization, Rendering, posterize, render},
};

use super::renderer::{Adapter, FrameTimes, Job, PosterizeSettings, Render, Views};
use crate::{Result, hex};

/// Renders with [`plenoctree::reference`].
pub struct ReferenceRenderer {
    job: Job,
}

impl ReferenceRenderer {
    /// Creates a renderer for a job.
    pub fn new(job: Job) -> Self {
        Self { job }
    }
}

impl Render for ReferenceRenderer {
    fn render(&mut self, camera: &PinholeCamera) -> Result<(Views, FrameTimes)> {
        let Job { field, palette, recolored, posterize: settings, background, .. } = &self.job;
        let background = DVec3::from(background.map(|c| f64::from(c) / 255.0));
        let settings = posterization(*settings);
        let colors = |colors: &[[f64; 3]]| colors.iter().map(|&color| color.into()).collect::<Vec<DVec3>>();
        let source = colors(&palette.colors);

        let start = Instant::now();
        let rendering = render(field, camera);
        let volume = start.elapsed();
        let posterized = to_image(&rendering, &posterize(&rendering, background, &source, &source, &settings));
        let total = start.elapsed();
        let views = Views {
            original: to_image(&rendering, &rendering.over(background)),
            posterized,
            recolored: recolored.as_ref().map(|shown| {
                to_image(&rendering, &posterize(&rendering, background, &source, &colors(shown), &settings))
            }),
        };
        let times = FrameTimes {
            volume: Some(volume.as_secs_f64() * 1e3),
            posterize: Some((total - volume).as_secs_f64() * 1e3),
            total: Some(total.as_secs_f64() * 1e3),
        };
        Ok((views, times))
    }

    fn adapter(&self) -> Adapter {
        Adapter { name: "float64 reference".into(), backend: "cpu".into(), driver: env!("CARGO_PKG_VERSION").into() }
    }
}

fn posterization(settings: PosterizeSettings) -> Posterization {
    Posterization {
        blend_steps: settings.blend_steps,
        softness: settings.softness.into(),
        min_opacity: settings.min_opacity.into(),
        ..Posterization::default()
    }
}

/// Returns the colors as an image of the rendering's size.
fn to_image(size: &Rendering, colors: &[DVec3]) -> RgbImage {
    RgbImage::from_fn(size.width as u32, size.height as u32, |x, y| {
        image::Rgb(hex::quantize(colors[y as usize * size.width + x as usize].to_array()))
    })
}
