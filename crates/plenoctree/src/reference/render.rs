//! Volume rendering: section 2 of the method (equations 1 to 4 of the paper).

use glam::DVec3;
use rayon::prelude::*;

use crate::{camera::PinholeCamera, field::PlenOctree};

/// An image of a field, without a background. Pixels are stored row by row, from the top left corner.
#[derive(Clone, Debug)]
pub struct Rendering {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Accumulated color `C` of every pixel, in encoded sRGB, premultiplied by opacity.
    pub color: Vec<DVec3>,
    /// Accumulated opacity `A` of every pixel, 0 to 1.
    pub opacity: Vec<f64>,
}

impl Rendering {
    /// Composites the rendering over `background`, both in encoded sRGB: `C + T c0`.
    pub fn over(&self, background: DVec3) -> Vec<DVec3> {
        self.color.iter().zip(&self.opacity).map(|(c, a)| c + (1.0 - a) * background).collect()
    }
}

/// Renders the field as `camera` sees it, with one ray through the center of every pixel.
pub fn render(field: &PlenOctree, camera: &PinholeCamera) -> Rendering {
    let (width, height) = (camera.width as usize, camera.height as usize);
    let (color, opacity) = (0..width * height)
        .into_par_iter()
        .map(|pixel| {
            let (origin, direction) = camera.ray((pixel % width) as f64 + 0.5, (pixel / width) as f64 + 0.5);
            field.render_ray(origin, direction)
        })
        .unzip();
    Rendering { width, height, color, opacity }
}
