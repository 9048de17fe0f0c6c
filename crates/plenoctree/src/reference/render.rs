//! Volume rendering, section 2 of the method (equations 1 to 4 of the paper).

use glam::DVec3;
use rayon::prelude::*;

use crate::{camera::PinholeCamera, field::PlenOctree};

/// A rendered field before any background: rows from the top, pixels from the left.
#[derive(Clone, Debug)]
pub struct Rendering {
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Accumulated color `C` of every pixel, encoded sRGB weighed by opacity (premultiplied).
    pub color: Vec<DVec3>,
    /// Accumulated opacity `A` of every pixel, 0 to 1.
    pub opacity: Vec<f64>,
}

impl Rendering {
    /// `C + T c0`: the picture over a background in encoded sRGB.
    pub fn over(&self, background: DVec3) -> Vec<DVec3> {
        self.color.iter().zip(&self.opacity).map(|(c, a)| c + (1.0 - a) * background).collect()
    }
}

/// The field as `camera` sees it: one ray through the center of every pixel. The camera stands in the field's frame.
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
