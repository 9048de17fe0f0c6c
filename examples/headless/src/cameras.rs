//! Cameras around a field.

use std::f64::consts::TAU;

use bevy_plenoctree::PlenOctree;
use image::RgbaImage;
use plenoctree::camera::PinholeCamera;

/// The azimuth of the first camera and the elevation of all, in radians.
const START: (f64, f64) = (0.42, 0.3);
/// The part of the image that the field fills, along one of its sides.
const FILL: f64 = 0.94;
/// How much darker than white a channel of the field must be, so that floaters do not count.
const DARKER: u8 = 64;

/// Returns cameras all around a field, each of which shows all of it. `None` if it is empty.
pub fn around(field: &PlenOctree, (count, size): (u32, u32)) -> Option<Vec<PinholeCamera>> {
    let azimuth = |index| START.0 + TAU * f64::from(index) / f64::from(count);
    (0..count).map(|index| PinholeCamera::around(field, size, size, azimuth(index), START.1)).collect()
}

/// The part of images that the field covers: a square.
#[derive(Clone, Copy)]
pub struct Frame {
    /// The upper left corner, and the length of a side, as fractions of the images' size.
    left: f64,
    top: f64,
    side: f64,
}

impl Frame {
    /// Finds the frame of images from all around, over white. The field turns about its middle.
    pub fn of(images: &[RgbaImage]) -> Self {
        let (mut half, mut top, mut bottom) = (0.0, 1.0, 0.0);
        for image in images {
            let size = f64::from(image.width());
            let dark =
                image.enumerate_pixels().filter(|(.., pixel)| pixel.0.iter().any(|channel| *channel < 255 - DARKER));
            for (x, y, _) in dark {
                half = f64::max(half, ((f64::from(x) + 0.5) / size - 0.5).abs());
                (top, bottom) = (f64::min(top, f64::from(y) / size), f64::max(bottom, f64::from(y + 1) / size));
            }
        }
        // White fields show nothing.
        if half == 0.0 {
            return Self { left: 0.0, top: 0.0, side: 1.0 };
        }
        let side = f64::max(2.0 * half, bottom - top) / FILL;
        Self { left: 0.5 * (1.0 - side), top: 0.5 * (top + bottom - side), side }
    }

    /// Returns a camera that shows only this part.
    pub fn zoom(self, camera: &PinholeCamera) -> PinholeCamera {
        let (width, height) = (f64::from(camera.width), f64::from(camera.height));
        PinholeCamera {
            focal_x: camera.focal_x / self.side,
            focal_y: camera.focal_y / self.side,
            center_x: (camera.center_x - self.left * width) / self.side,
            center_y: (camera.center_y - self.top * height) / self.side,
            ..*camera
        }
    }
}
