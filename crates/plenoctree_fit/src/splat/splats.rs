//! The Gaussians of a capture.

use glam::{DAffine3, DMat3, DVec3, Quat, Vec3};
use plenoctree::Basis;

use super::{
    axis::Axis,
    harmonics::{Rotation, functions},
    shape::principal,
};

/// Highest degree of spherical harmonics.
pub(super) const MOST_DEGREE: u32 = 3;
/// Largest coordinate and size. Larger ones are damaged, and would overflow float32 when squared.
const LARGEST: f32 = 1e9;
/// Largest coefficient. Those of captures are below 10.
const LARGEST_COEFFICIENT: f32 = 1e4;
/// Coefficients below this belong to a degree that the format stores but the capture does not have.
const SMALLEST_COEFFICIENT: f32 = 1e-6;

/// A Gaussian of a capture: an ellipsoid that is densest at its center.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian {
    /// Its center.
    pub position: Vec3,
    /// Standard deviations along its own axes, in world units. At least 0.
    pub scale: Vec3,
    /// The rotation from its own axes to the capture's. A unit quaternion.
    pub rotation: Quat,
    /// Opacity of a ray through its center, 0 to 1.
    pub opacity: f32,
}

/// A capture: Gaussians with colors, in the coordinates of the `.ply` file that trainers write. In most captures, -y is
/// up.
///
/// The color of a Gaussian is encoded sRGB, `max(0.5 + sum of coefficients times harmonics, 0)`. The harmonics are
/// those of [`Basis`], in the direction from the camera to the center of the Gaussian.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Splats {
    gaussians: Vec<Gaussian>,
    degree: u32,
    coefficients: Vec<Vec3>,
    dropped: usize,
    antialiased: bool,
    pub(super) assumes_axes: bool,
    pub(super) up: Option<Axis>,
}

impl Splats {
    /// Creates an empty capture with harmonics of a degree, at most 3.
    pub fn new(degree: u32) -> Self {
        Self { degree: degree.min(MOST_DEGREE), ..Self::default() }
    }

    /// Adds a Gaussian, with (degree + 1)² coefficients for red, green and blue; missing ones are 0. Rotations are
    /// normalized, and those without a length are none.
    ///
    /// Gaussians with numbers that are not finite, or implausibly large, are left out and counted in [`Self::dropped`].
    pub fn push(&mut self, gaussian: Gaussian, coefficients: &[Vec3]) {
        let Gaussian { position, scale, mut rotation, opacity } = gaussian;
        if rotation == Quat::from_array([0.0; 4]) {
            rotation = Quat::IDENTITY;
        }
        let length = rotation.length();
        let valid = position.abs().max_element() <= LARGEST
            && position.is_finite()
            && scale.is_finite()
            && scale.max_element() <= LARGEST
            && scale.min_element() >= 0.0
            && length.is_finite()
            && length > 1e-12
            && (0.0..=1.0).contains(&opacity)
            && coefficients.iter().all(|k| k.is_finite() && k.abs().max_element() <= LARGEST_COEFFICIENT);
        if !valid {
            self.dropped += 1;
            return;
        }
        self.gaussians.push(Gaussian { rotation: rotation * length.recip(), ..gaussian });
        let count = functions(self.degree);
        self.coefficients.extend((0..count).map(|index| coefficients.get(index).copied().unwrap_or(Vec3::ZERO)));
    }

    /// Returns a capture without Gaussians that is like this one in everything else.
    fn emptied(&self) -> Self {
        let Self { degree, dropped, antialiased, assumes_axes, up, .. } = *self;
        Self { degree, dropped, antialiased, assumes_axes, up, ..Self::default() }
    }

    /// Reserves memory for `count` more Gaussians.
    pub(super) fn reserve(&mut self, count: usize) {
        self.gaussians.reserve(count);
        self.coefficients.reserve(count * functions(self.degree));
    }

    /// Returns the number of Gaussians.
    pub fn len(&self) -> usize {
        self.gaussians.len()
    }

    /// Returns whether there are none.
    pub fn is_empty(&self) -> bool {
        self.gaussians.is_empty()
    }

    /// Returns the number of Gaussians that were left out because their numbers are damaged.
    pub fn dropped(&self) -> usize {
        self.dropped
    }

    /// Returns whether the capture was trained with antialiasing (Mip-Splatting): Gaussians that are blurred when they
    /// are drawn keep what they cover in all, not their opacity. False unless the file says so.
    pub fn antialiased(&self) -> bool {
        self.antialiased
    }

    /// Sets whether the capture was trained with antialiasing: see [`Self::antialiased`].
    pub fn set_antialiased(&mut self, antialiased: bool) {
        self.antialiased = antialiased;
    }

    /// Returns whether most Gaussians are so far from the origin that the digits of float32, which holds positions, are
    /// farther apart than these are wide. Only a capture that is exported nearer to the origin looks right.
    pub fn is_too_far(&self) -> bool {
        let is_lost = |gaussian: &&Gaussian| {
            let width = gaussian.scale.max_element();
            width > 0.0 && gaussian.position.abs().max_element() * f32::EPSILON > width
        };
        2 * self.gaussians.iter().filter(is_lost).count() > self.len()
    }

    /// Returns whether the capture is from an SPZ file that does not record its axes, and these had to be assumed
    /// because [`SpzAxes::Unknown`](super::SpzAxes::Unknown) was set. If they are wrong, the capture is upside down.
    pub fn assumes_axes(&self) -> bool {
        self.assumes_axes
    }

    /// Returns the direction that is up in the coordinates of the file, if the file says so.
    pub fn up(&self) -> Option<Axis> {
        self.up
    }

    /// Returns the degree of the harmonics, 0 to 3.
    pub fn degree(&self) -> u32 {
        self.degree
    }

    /// Returns all Gaussians.
    pub fn gaussians(&self) -> &[Gaussian] {
        &self.gaussians
    }

    /// Returns the coefficients of a Gaussian, for red, green and blue: (degree + 1)² of them.
    ///
    /// # Panics
    ///
    /// Panics if `index` is not less than [`Self::len`].
    pub fn coefficients(&self, index: usize) -> &[Vec3] {
        let count = functions(self.degree);
        &self.coefficients[index * count..][..count]
    }

    /// Returns the color of a Gaussian, in encoded sRGB: at least 0, and above 1 where it is overexposed. `direction`
    /// is a unit vector from the camera to it.
    ///
    /// # Panics
    ///
    /// Panics if `index` is not less than [`Self::len`].
    pub fn color(&self, index: usize, direction: DVec3) -> Vec3 {
        let coefficients = self.coefficients(index);
        let sum = if self.degree == 0 {
            coefficients[0] * Basis::FACTORS[0] as f32
        } else {
            let y = Basis::Sh16.evaluate(direction);
            coefficients.iter().zip(y).map(|(k, y)| *k * y as f32).sum()
        };
        (sum + 0.5).max(Vec3::ZERO)
    }

    /// Returns the capture with the Gaussians for which `keep` returns `true`.
    pub fn filtered(&self, keep: impl Fn(&Gaussian) -> bool) -> Self {
        self.picked((0..self.len()).filter(|index| keep(&self.gaussians[*index])))
    }

    /// Returns the capture with the first of every `n` Gaussians, in the order of the file. All of them if `n` is 0.
    pub fn thinned(&self, n: usize) -> Self {
        self.picked((0..self.len()).step_by(n.max(1)))
    }

    fn picked(&self, indices: impl Iterator<Item = usize>) -> Self {
        let mut picked = self.emptied();
        for index in indices {
            picked.gaussians.push(self.gaussians[index]);
            picked.coefficients.extend_from_slice(self.coefficients(index));
        }
        picked
    }

    /// Returns the transformed capture. Its harmonics turn with it.
    ///
    /// The transform may scale, also by axis, and mirror. [`Self::up`] stays what the file says.
    pub fn transformed(&self, transform: DAffine3) -> Self {
        let linear = transform.matrix3;
        let rotation = orthonormal(linear);
        let turned = Rotation::new(rotation);
        let width = linear.determinant().abs().cbrt();
        let similar = (linear - rotation * width).to_cols_array().iter().all(|x| x.abs() <= 1e-6 * width);
        let mut result = self.emptied();
        result.reserve(self.len());
        let mut coefficients = [Vec3::ZERO; 16];
        for (index, gaussian) in self.gaussians.iter().enumerate() {
            let axes = DMat3::from_quat(gaussian.rotation.as_dquat().normalize());
            let scale = gaussian.scale.as_dvec3();
            let (axes, scale) = if similar {
                (rotation * axes, width * scale)
            } else {
                principal(linear * axes * DMat3::from_diagonal(scale))
            };
            // An ellipsoid is its own mirror image along each of its axes.
            let axes =
                if axes.determinant() < 0.0 { DMat3::from_cols(-axes.x_axis, axes.y_axis, axes.z_axis) } else { axes };
            let moved = Gaussian {
                position: transform.transform_point3(gaussian.position.as_dvec3()).as_vec3(),
                scale: scale.as_vec3(),
                rotation: glam::DQuat::from_mat3(&axes).normalize().as_quat(),
                opacity: gaussian.opacity,
            };
            let own = self.coefficients(index);
            turned.apply(own, &mut coefficients[..own.len()]);
            result.push(moved, &coefficients[..own.len()]);
        }
        result
    }

    /// Returns the capture without degrees of harmonics in which every coefficient is 0.
    pub(super) fn trimmed(mut self) -> Self {
        let stride = functions(self.degree);
        let used = |index: usize| {
            self.coefficients[index..].iter().step_by(stride).any(|k| k.abs().max_element() > SMALLEST_COEFFICIENT)
        };
        let highest = (1..stride).rev().find(|&index| index < self.coefficients.len() && used(index)).unwrap_or(0);
        let degree = (0..=self.degree).find(|&degree| functions(degree) > highest).unwrap_or(0);
        if degree < self.degree {
            let count = functions(degree);
            self.coefficients = self.coefficients.chunks_exact(stride).flat_map(|own| &own[..count]).copied().collect();
            self.degree = degree;
        }
        self
    }

    /// Adds the Gaussians of another capture. The result is antialiased if both are.
    pub(super) fn append(&mut self, other: &Self) {
        if other.degree > self.degree {
            let mut wider = Self { degree: other.degree, dropped: 0, ..self.emptied() };
            wider.append(self);
            *self = wider;
        }
        if !other.is_empty() {
            self.antialiased = other.antialiased && (self.antialiased || self.is_empty());
        }
        self.reserve(other.len());
        for (index, gaussian) in other.gaussians.iter().enumerate() {
            self.push(*gaussian, other.coefficients(index));
        }
        self.dropped += other.dropped;
    }
}

/// Returns the nearest orthogonal matrix to one whose columns are nearly perpendicular: its rotation, or mirrored
/// rotation.
fn orthonormal(linear: DMat3) -> DMat3 {
    let x = linear.x_axis.normalize_or(DVec3::X);
    let y = (linear.y_axis - x * x.dot(linear.y_axis)).normalize_or(x.any_orthonormal_vector());
    let z = x.cross(y);
    DMat3::from_cols(x, y, if z.dot(linear.z_axis) < 0.0 { -z } else { z })
}
