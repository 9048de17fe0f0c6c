//! Cameras that frame a field.

use glam::{DMat4, DVec3};

use super::PinholeCamera;
use crate::field::{PlenOctree, UpAxis};

/// Horizontal field of view of these cameras, in radians.
const FOV: f64 = 0.6;

impl PinholeCamera {
    /// Creates a camera that shows all of a field except its floaters ([`PlenOctree::dense_bounds`]) in an image of
    /// `width` x `height` pixels. Returns `None` if the field is empty.
    ///
    /// `azimuth` turns the camera around the field's up axis, starting at the front: -y if z is up, +z if y is up.
    /// `elevation` raises it above the horizon. Both are in radians.
    pub fn around(field: &PlenOctree, width: u32, height: u32, azimuth: f64, elevation: f64) -> Option<Self> {
        let (low, high) = field.dense_bounds()?;
        let (center, radius) = (0.5 * (low + high), 0.5 * (high - low).length());
        let camera = Self::new(width, height, FOV, DMat4::IDENTITY);
        // The narrower side of the image determines the distance.
        let narrow = (0.5 * f64::from(width.min(height)) / camera.focal_x).atan();
        let (up, right, front) = match field.up() {
            UpAxis::Y => (DVec3::Y, DVec3::X, DVec3::Z),
            UpAxis::Z => (DVec3::Z, DVec3::X, DVec3::NEG_Y),
        };
        let around = azimuth.sin() * right + azimuth.cos() * front;
        let outward = elevation.cos() * around + elevation.sin() * up;
        Some(camera.looking_at(center + radius / narrow.sin() * outward, center, up))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        bake::{BakeSettings, bake},
        field::Basis,
    };

    /// The corners of the box around the field are in the image, for any aspect ratio.
    #[test]
    fn the_whole_field_is_in_the_image() {
        let settings =
            BakeSettings { depth: 4, max: DVec3::new(3.0, 1.0, 1.0), basis: Basis::Rgba, ..Default::default() };
        let field = bake(&settings, |_| 1.0, |_| |_| DVec3::ONE).unwrap();
        let (low, high) = field.dense_bounds().unwrap();
        for (width, height, azimuth, elevation) in [(80, 80, 0.3, 0.4), (160, 40, 2.0, -0.5), (30, 90, 4.0, 1.2)] {
            let camera = PinholeCamera::around(&field, width, height, azimuth, elevation).unwrap();
            for corner in 0..8 {
                let pick = DVec3::new(f64::from(corner & 1), f64::from(corner >> 1 & 1), f64::from(corner >> 2));
                let seen = camera.rotation.transpose() * (low + pick * (high - low) - camera.position);
                let x = camera.center_x - camera.focal_x * seen.x / seen.z;
                let y = camera.center_y + camera.focal_y * seen.y / seen.z;
                assert!(seen.z < 0.0 && x > 0.0 && x < width.into() && y > 0.0 && y < height.into(), "{x}, {y}");
            }
        }
    }
}
