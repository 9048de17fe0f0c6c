use glam::{DMat3, DMat4, DVec3};

/// A pinhole camera in a field's frame. It looks along its -z, y is up; pixels count from the top left corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PinholeCamera {
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Focal length in pixels, horizontally.
    pub focal_x: f64,
    /// Focal length in pixels, vertically.
    pub focal_y: f64,
    /// Where the optical axis meets the picture, in pixels from the left edge.
    pub center_x: f64,
    /// Where the optical axis meets the picture, in pixels from the upper edge.
    pub center_y: f64,
    /// The camera's axes in the field's frame.
    pub rotation: DMat3,
    /// The camera's place in the field's frame.
    pub position: DVec3,
}

impl PinholeCamera {
    /// A camera with square pixels and the optical axis in the middle; `fov_x` is the horizontal angle of view in radians.
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

    /// The camera at `position` that looks at `target`.
    pub fn looking_at(mut self, position: DVec3, target: DVec3, up: DVec3) -> Self {
        let back = (position - target).normalize_or(DVec3::Z);
        let right = up.cross(back).try_normalize().unwrap_or_else(|| back.any_orthonormal_vector());
        self.rotation = DMat3::from_cols(right, back.cross(right), back);
        self.position = position;
        self
    }

    /// The same view in another number of pixels.
    pub fn resized(mut self, width: u32, height: u32) -> Self {
        let (x, y) = (f64::from(width) / f64::from(self.width), f64::from(height) / f64::from(self.height));
        self.focal_x *= x;
        self.center_x *= x;
        self.focal_y *= y;
        self.center_y *= y;
        (self.width, self.height) = (width, height);
        self
    }

    /// Origin and unit direction of the ray through the point (`x`, `y`) of the picture, in pixels. Pixel centers lie
    /// at halves.
    pub fn ray(&self, x: f64, y: f64) -> (DVec3, DVec3) {
        let direction = DVec3::new((x - self.center_x) / self.focal_x, (self.center_y - y) / self.focal_y, -1.0);
        (self.position, (self.rotation * direction).normalize())
    }
}
