//! Rotates spherical harmonics.

use glam::{DMat3, DVec3, Vec3};
use plenoctree::Basis;

/// Returns the number of harmonics up to a degree.
pub fn functions(degree: u32) -> usize {
    (degree as usize + 1).pow(2)
}

/// Nodes and weights of Gauss-Legendre quadrature, which is exact for products of two harmonics up to degree 3.
const HEIGHTS: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
    (-0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
    (0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
];
/// Directions at each height.
const AROUND: u32 = 8;

/// Returns directions and weights with which sums over the sphere are exact for products of two harmonics up to degree
/// 3.
pub fn quadrature() -> impl Iterator<Item = (DVec3, f64)> {
    HEIGHTS.into_iter().flat_map(|(z, weight)| {
        (0..AROUND).map(move |step| {
            let angle = std::f64::consts::TAU * (f64::from(step) + 0.5) / f64::from(AROUND);
            let radius = (1.0 - z * z).sqrt();
            let direction = DVec3::new(radius * angle.cos(), radius * angle.sin(), z);
            (direction, weight * std::f64::consts::TAU / f64::from(AROUND))
        })
    })
}

/// The effect of a rotation, possibly mirrored, on coefficients up to degree 3.
pub struct Rotation([[f32; 16]; 16]);

impl Rotation {
    /// `turn` is orthogonal.
    pub fn new(turn: DMat3) -> Self {
        // The coefficients of the turned harmonics, by projection.
        let mut matrix = [[0.0; 16]; 16];
        for (direction, weight) in quadrature() {
            let (new, old) = (Basis::Sh16.evaluate(direction), Basis::Sh16.evaluate(turn.transpose() * direction));
            for (row, new) in matrix.iter_mut().zip(new) {
                for (entry, old) in row.iter_mut().zip(old) {
                    *entry += weight * new * old;
                }
            }
        }
        Self(matrix.map(|row| row.map(|entry| if entry.abs() < 1e-12 { 0.0 } else { entry as f32 })))
    }

    /// Computes the coefficients that look from a direction as `old` does from the direction before the turn.
    pub fn apply(&self, old: &[Vec3], new: &mut [Vec3]) {
        for (new, row) in new.iter_mut().zip(&self.0) {
            *new = old.iter().zip(row).map(|(old, entry)| *old * *entry).sum();
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// A turned capture has the original's color along each turned direction.
        #[test]
        fn turned_harmonics_look_the_same(
            turn in prop::array::uniform4(-1.0f64..1.0),
            mirrored: bool,
            look in prop::array::uniform3(-1.0f64..1.0),
            coefficients in prop::collection::vec(prop::array::uniform3(-1.0f32..1.0), 16),
        ) {
            let (turn, look) = (DQuat::from_array(turn), DVec3::from_array(look));
            prop_assume!(turn.length() > 0.1 && look.length() > 0.1);
            let mirror = DMat3::from_diagonal(DVec3::new(1.0, if mirrored { -1.0 } else { 1.0 }, 1.0));
            let (turn, look) = (DMat3::from_quat(turn.normalize()) * mirror, look.normalize());
            let old: Vec<Vec3> = coefficients.into_iter().map(Vec3::from_array).collect();
            let mut new = [Vec3::ZERO; 16];
            Rotation::new(turn).apply(&old, &mut new);
            let sum = |k: &[Vec3], direction: DVec3| -> Vec3 {
                k.iter().zip(Basis::Sh16.evaluate(direction)).map(|(k, y)| *k * y as f32).sum()
            };
            prop_assert!((sum(&old, look) - sum(&new, turn * look)).abs().max_element() < 1e-5);
        }
    }
}
