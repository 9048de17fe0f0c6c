//! Projects Gaussians to the image.

use glam::{DMat3, DVec2, DVec3, Vec2, Vec3};
use plenoctree::camera::PinholeCamera;

use crate::splat::splats::Splats;

/// Depth below which Gaussians are left out, in world units, unless they are smaller.
const NEAR: f64 = 0.01;
/// The variance by which every Gaussian is blurred in the image, in square pixels.
pub const SPLAT_BLUR: f64 = 0.3;
/// How far outside the image the derivative of the projection is evaluated, in multiples of half its size. Beyond that,
/// it does not approximate the projection.
const OUTSIDE: f64 = 1.3;
/// Opacity below which nothing is drawn.
pub const FAINTEST: f32 = 1.0 / 255.0;

/// More than the square of the distance within which any Gaussian is visible, in deviations: `2 ln 255`, for an opacity
/// of 1.
const MOST_SQUARE: f64 = 11.1;

/// A Gaussian in the image.
#[derive(Clone, Copy, Debug)]
pub struct Projected {
    /// Its index in the capture.
    pub index: u32,
    pub depth: f32,
    /// Center, in pixels.
    pub center: Vec2,
    /// The inverse of its variances: x x, x y and y y.
    pub conic: Vec3,
    pub opacity: f32,
    pub color: Vec3,
    /// Square of the distance from the center within which it is visible, in deviations.
    pub square: f32,
    /// The same distance along each axis, in pixels.
    pub reach: Vec2,
}

impl Projected {
    /// Returns the lowest and the highest place along an axis where it is visible.
    pub fn span(&self, axis: usize) -> [f32; 2] {
        [self.center[axis] - self.reach[axis], self.center[axis] + self.reach[axis]]
    }
}

/// Projects a Gaussian. Returns `None` if it cannot be in the image. `color` returns that of its index in a direction.
pub fn project(
    splats: &Splats,
    index: usize,
    camera: &PinholeCamera,
    color: impl Fn(usize, DVec3) -> Vec3,
) -> Option<Projected> {
    let gaussian = splats.gaussians()[index];
    if gaussian.opacity < FAINTEST {
        return None;
    }
    let offset = gaussian.position.as_dvec3() - camera.position;
    let at = camera.rotation.transpose() * offset;
    // From here on, y points down and z away from the camera, as in images.
    let (x, y, depth) = (at.x, -at.y, -at.z);
    if depth <= NEAR.min(gaussian.scale.max_element().into()) {
        return None;
    }
    let center = DVec2::new(camera.focal_x * x / depth + camera.center_x, camera.focal_y * y / depth + camera.center_y);
    let size = DVec2::new(camera.width.into(), camera.height.into());
    let focal = DVec2::new(camera.focal_x, camera.focal_y);
    let most = OUTSIDE * 0.5 * size / focal;
    let scale = gaussian.scale.as_dvec3();
    // Most Gaussians are not in a view from nearby, even if each were a ball.
    let widest = scale.max_element() / depth * focal;
    let farthest = (MOST_SQUARE * (widest * widest * (1.0 + most * most) + SPLAT_BLUR)).map(f64::sqrt);
    let is_outside = |reach: DVec2| (center + reach).cmplt(DVec2::ZERO).any() || (center - reach).cmpgt(size).any();
    if is_outside(farthest) {
        return None;
    }
    let [tangent_x, tangent_y] = (DVec2::new(x, y) / depth).clamp(-most, most).to_array();
    // The derivative of the pixel, in the axes of the camera, whose y points up and whose z points back.
    let across = camera.rotation * DVec3::new(1.0, 0.0, tangent_x) * (camera.focal_x / depth);
    let down = camera.rotation * DVec3::new(0.0, -1.0, tangent_y) * (camera.focal_y / depth);
    let axes = DMat3::from_quat(gaussian.rotation.as_dquat()).transpose();
    let (across, down) = (scale * (axes * across), scale * (axes * down));
    let (xx, xy, yy) = (across.length_squared() + SPLAT_BLUR, across.dot(down), down.length_squared() + SPLAT_BLUR);
    let determinant = xx * yy - xy * xy;
    let mut opacity = gaussian.opacity;
    if splats.antialiased() {
        // What it covers in all is that of the Gaussian without blur.
        let own = (xx - SPLAT_BLUR) * (yy - SPLAT_BLUR) - xy * xy;
        opacity *= (own / determinant).max(0.0).sqrt() as f32;
        if opacity < FAINTEST {
            return None;
        }
    }
    let conic = DVec3::new(yy, -xy, xx) / determinant;
    // Where the opacity falls below the faintest.
    let square = 2.0 * f64::from(opacity / FAINTEST).ln();
    let reach = DVec2::new((square * xx).sqrt(), (square * yy).sqrt());
    if !conic.is_finite() || is_outside(reach) {
        return None;
    }
    Some(Projected {
        index: index as u32,
        depth: depth as f32,
        center: center.as_vec2(),
        conic: conic.as_vec3(),
        opacity,
        color: color(index, offset.normalize()),
        square: square as f32,
        reach: reach.as_vec2(),
    })
}
