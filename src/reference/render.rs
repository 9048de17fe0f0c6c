//! Volume rendering, section 2 of the method (equations 1 to 4 of the paper).

use std::ops::ControlFlow;

use glam::DVec3;
use rayon::prelude::*;

use super::march;
use crate::{camera::PinholeCamera, field::PlenOctree};

/// Transmittance under which a march stops and the pixel counts as opaque.
pub const STOP_TRANSMITTANCE: f64 = 1e-2;

/// A rendered field before any background: rows from the top, pixels from the left.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Accumulated color `C` of every pixel, encoded sRGB weighed by opacity (premultiplied).
    pub color: Vec<DVec3>,
    /// Accumulated opacity `A` of every pixel, 0 to 1.
    pub opacity: Vec<f64>,
}

impl Picture {
    /// `C + T c0`: the picture over a background in encoded sRGB.
    pub fn over(&self, background: DVec3) -> Vec<DVec3> {
        self.color.iter().zip(&self.opacity).map(|(c, a)| c + (1.0 - a) * background).collect()
    }
}

/// Color `C` and opacity `A` seen along one ray of the field's frame. `direction` is a unit vector.
pub fn render_ray(field: &PlenOctree, origin: DVec3, direction: DVec3) -> (DVec3, f64) {
    let y = field.basis().evaluate(direction);
    // The sum of the weights is 1 - transmittance, without its cancellation where little is lost.
    let (mut color, mut transmittance, mut sum) = (DVec3::ZERO, 1.0, 0.0);
    march(field, origin, direction, |crossing| {
        let depth = f64::from(field.densities()[crossing.leaf as usize]) * crossing.length;
        let opacity = -(-depth).exp_m1();
        let weight = transmittance * opacity;
        sum += weight;
        color += weight * field.radiance_with(crossing.leaf, &y);
        transmittance *= 1.0 - opacity;
        if transmittance < STOP_TRANSMITTANCE { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    if transmittance < STOP_TRANSMITTANCE { (color / sum, 1.0) } else { (color, sum) }
}

/// The field as `camera` sees it: one ray through the center of every pixel. The camera stands in the field's frame.
pub fn render(field: &PlenOctree, camera: &PinholeCamera) -> Picture {
    let (width, height) = (camera.width as usize, camera.height as usize);
    let (color, opacity) = (0..width * height)
        .into_par_iter()
        .map(|pixel| {
            let (origin, direction) = camera.ray((pixel % width) as f64 + 0.5, (pixel / width) as f64 + 0.5);
            render_ray(field, origin, direction)
        })
        .unzip();
    Picture { width, height, color, opacity }
}
