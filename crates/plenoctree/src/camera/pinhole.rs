//! Pinhole cameras and their rays.

use glam::{DMat3, DMat4, DVec3};

/// A pinhole camera in a field's frame.
///
/// It looks along its -z, and its y points up. Pixels are counted from the top left corner of the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PinholeCamera {
    /// Width of the image in pixels.
    pub width: u32,
    /// Height of the image in pixels.
    pub height: u32,
    /// Horizontal focal length in pixels.
    pub focal_x: f64,
    /// Vertical focal length in pixels.
    pub focal_y: f64,
    /// Point where the optical axis meets the image, in pixels from the left edge.
    pub center_x: f64,
    /// Point where the optical axis meets the image, in pixels from the top edge.
    pub center_y: f64,
    /// Axes of the camera in the field's frame.
    pub rotation: DMat3,
    /// Position of the camera in the field's frame.
    pub position: DVec3,
}

impl PinholeCamera {
    /// Creates a camera with square pixels and the optical axis in the middle of the image.
    ///
    /// `fov_x` is the horizontal field of view in radians. `world_from_camera` is a rotation and a translation from the
    /// camera to the field's frame.
    pub fn new(width: u32, height: u32, fov_x: f64, world_from_camera: DMat4) -> Self {
        let focal = 0.5 * f64::from(width) / (0.5 * fov_x).tan();
        Self {
            width,
            height,
            focal_x: focal,
            focal_y: focal,
            center_x: 0.5 * f64::from(width),
            center_y: 0.5 * f64::from(height),
            rotation: DMat3::from_mat4(world_from_camera),
            position: world_from_camera.w_axis.truncate(),
        }
    }

    /// Moves the camera to `position` and turns it toward `target`, both in the field's frame.
    pub fn looking_at(mut self, position: DVec3, target: DVec3, up: DVec3) -> Self {
        let back = (position - target).normalize_or(DVec3::Z);
        let right = up.cross(back).try_normalize().unwrap_or_else(|| back.any_orthonormal_vector());
        self.rotation = DMat3::from_cols(right, back.cross(right), back);
        self.position = position;
        self
    }

    /// Returns the camera with the same view, but an image of `width` x `height` pixels.
    pub fn resized(mut self, width: u32, height: u32) -> Self {
        let (x, y) = (f64::from(width) / f64::from(self.width), f64::from(height) / f64::from(self.height));
        self.focal_x *= x;
        self.center_x *= x;
        self.focal_y *= y;
        self.center_y *= y;
        (self.width, self.height) = (width, height);
        self
    }

    /// Returns the origin and the unit direction of the ray through the point (`x`, `y`) of the image, in the field's
    /// frame.
    ///
    /// The point is in pixels. Pixel centers are at +0.5.
    pub fn ray(&self, x: f64, y: f64) -> (DVec3, DVec3) {
        let direction = DVec3::new((x - self.center_x) / self.focal_x, (self.center_y - y) / self.focal_y, -1.0);
        (self.position, (self.rotation * direction).normalize())
    }
}
