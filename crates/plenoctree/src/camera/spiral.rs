//! Cameras all around something.

use glam::{DMat4, DVec3, Vec3Swizzles};

use super::PinholeCamera;
use crate::{field::UpAxis, sphere::spiral};

/// A spiral of cameras around a ball, which all look at its center, a golden angle apart. They are spread evenly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spiral {
    /// Center of the ball, in the field's frame.
    pub center: DVec3,
    /// Radius of the ball, above 0, in world units.
    pub radius: f64,
    /// The axis that points up in images.
    pub up: UpAxis,
    /// Field of view in radians, between 0 and pi.
    pub fov: f64,
    /// Sines of the elevations at which the spiral begins and ends: 1 is above the ball, 0 at the horizon, and -1 below
    /// the ball.
    pub elevations: [f64; 2],
    /// Distances from the center, as multiples of the distance at which the ball just fits into the image. Cameras take
    /// turns with them; if there are none, the multiple is 1.
    pub distances: &'static [f64],
}

impl Spiral {
    /// Returns `count` cameras with images of `size` x `size` pixels, in the order of the spiral.
    pub fn cameras(self, count: u32, size: u32) -> impl Iterator<Item = PinholeCamera> {
        spiral(count, self.elevations).enumerate().map(move |(index, outward)| {
            let (up, outward) = match self.up {
                UpAxis::Y => (DVec3::Y, outward.xzy()),
                UpAxis::Z => (DVec3::Z, outward),
            };
            let multiple = self.distances.get(index % self.distances.len().max(1)).unwrap_or(&1.0);
            let distance = multiple * self.radius / (0.5 * self.fov).sin();
            let camera = PinholeCamera::new(size, size, self.fov, DMat4::IDENTITY);
            camera.looking_at(self.center + distance * outward, self.center, up)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The ball touches the edges of the image, at the right multiple of that distance, and no direction is far from a
    /// camera.
    #[test]
    fn cameras_are_all_around_the_ball() {
        for up in [UpAxis::Y, UpAxis::Z] {
            let center = DVec3::new(3.0, -1.0, 2.0);
            let spiral = Spiral { center, radius: 2.0, up, fov: 0.7, elevations: [1.0, -1.0], distances: &[1.0, 0.8] };
            let cameras: Vec<_> = spiral.cameras(100, 50).collect();
            assert_eq!(cameras.len(), 100);
            let upward = up.to_y_up().transpose() * DVec3::Y;
            for (index, camera) in cameras.iter().enumerate() {
                let multiple = [1.0, 0.8][index % 2];
                let (origin, forward) = camera.ray(25.0, 25.0);
                let (to, (_, edge)) = (center - origin, camera.ray(0.0, 25.0));
                assert!((to.normalize() - forward).length() < 1e-12);
                let nearest = (to - to.dot(edge) * edge).length();
                assert!((nearest - 2.0 * multiple).abs() < 1e-9, "{nearest}");
                assert!(camera.rotation.y_axis.dot(upward) > 0.0);
            }
            // The way from the top to the bottom.
            assert!(cameras.is_sorted_by_key(|camera| -(camera.position - center).normalize().dot(upward)));
            let outward: Vec<_> = cameras.iter().map(|camera| (camera.position - center).normalize()).collect();
            for other in (Spiral { radius: 1.0, ..spiral }).cameras(317, 1) {
                let direction = (other.position - center).normalize();
                let nearest = outward.iter().map(|outward| outward.dot(direction)).fold(-1.0, f64::max);
                assert!(nearest.acos() < 0.26, "{}", nearest.acos());
            }
        }
    }

    /// Part of a spiral stays between its elevations.
    #[test]
    fn spirals_begin_and_end_where_asked() {
        let spiral = Spiral {
            center: DVec3::ZERO,
            radius: 1.0,
            up: UpAxis::Z,
            fov: 0.6,
            elevations: [0.0, -1.0],
            distances: &[],
        };
        let heights: Vec<_> = spiral.cameras(4, 8).map(|camera| camera.position.normalize().z).collect();
        for (height, expected) in heights.iter().zip([-0.125, -0.375, -0.625, -0.875]) {
            assert!((height - expected).abs() < 1e-12, "{height}");
        }
    }
}
