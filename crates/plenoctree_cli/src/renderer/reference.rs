//! Renders with the float64 reference, on the CPU.

use std::time::Instant;

use glam::DVec3;
use image::{Rgb, RgbImage, Rgba, RgbaImage};
use plenoctree::{
    camera::PinholeCamera,
    reference::{Posterization, Rendering, posterize, render},
};

use super::interface::{Adapter, FrameTimes, Look, Render, Scene};
use crate::{hex, result::Result};

/// Renders with [`plenoctree::reference`].
pub struct ReferenceRenderer {
    scene: Scene,
    last: Option<View>,
}

/// A view, kept to posterize it several times.
struct View {
    camera: PinholeCamera,
    rendering: Rendering,
    milliseconds: f64,
}

impl ReferenceRenderer {
    /// Creates a renderer of a scene.
    pub fn new(scene: Scene) -> Self {
        Self { scene, last: None }
    }

    fn view(&mut self, camera: &PinholeCamera) -> &View {
        let last = self.last.take().filter(|view| view.camera == *camera);
        self.last.insert(last.unwrap_or_else(|| {
            let start = Instant::now();
            let rendering = render(&self.scene.field, camera);
            View { camera: *camera, rendering, milliseconds: start.elapsed().as_secs_f64() * 1e3 }
        }))
    }

    fn background(&self) -> DVec3 {
        DVec3::from(hex::unit(self.scene.background))
    }
}

impl Render for ReferenceRenderer {
    fn original(&mut self, camera: &PinholeCamera) -> Result<RgbaImage> {
        let background = self.background();
        let rendering = &self.view(camera).rendering;
        let colors = rendering.over(background);
        Ok(RgbaImage::from_fn(camera.width, camera.height, |x, y| {
            let pixel = y as usize * rendering.width + x as usize;
            let [r, g, b] = hex::quantize(colors[pixel].to_array());
            Rgba([r, g, b, (255.0 * rendering.opacity[pixel]).round() as u8])
        }))
    }

    fn posterized(&mut self, camera: &PinholeCamera, look: &Look) -> Result<(RgbImage, FrameTimes)> {
        let background = self.background();
        let View { rendering, milliseconds: volume, .. } = self.view(camera);
        let shown: Vec<DVec3> = look.shown.iter().map(|&color| color.into()).collect();
        let settings = Posterization { space: look.palette.label_space(), ..look.settings.posterization };
        let start = Instant::now();
        let colors = posterize(rendering, background, look.palette, &shown, &settings);
        let posterize = start.elapsed().as_secs_f64() * 1e3;
        let image = RgbImage::from_fn(camera.width, camera.height, |x, y| {
            Rgb(hex::quantize(colors[y as usize * rendering.width + x as usize].to_array()))
        });
        let times = FrameTimes { volume: Some(*volume), posterize: Some(posterize), total: Some(volume + posterize) };
        Ok((image, times))
    }

    fn adapter(&self) -> Adapter {
        Adapter { name: "float64 reference".into(), backend: "cpu".into(), driver: env!("CARGO_PKG_VERSION").into() }
    }
}
