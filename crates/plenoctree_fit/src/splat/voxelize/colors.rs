//! Converts the colors of splats to those of fields.

use glam::{DVec3, Vec3};
use plenoctree::{Activation, Basis};

use crate::splat::harmonics::quadrature;

/// Margin from 0 and 1 within which radiance is kept: near them, the inverse of the sigmoid is so steep that they would
/// dominate the fit.
const MARGIN: f64 = 0.01;

/// The harmonics along a few directions, and their weights.
pub struct Directions(Vec<([f64; 25], f64)>);

impl Directions {
    pub fn new() -> Self {
        Self(quadrature().map(|(direction, weight)| (Basis::Sh9.evaluate(direction), weight)).collect())
    }

    /// Returns the coefficients under a sigmoid that look like those of splats, channel by channel.
    pub fn convert(&self, splat: &[Vec3]) -> Vec<f32> {
        let count = splat.len();
        let mut result = vec![0.0; 3 * count];
        if count == 1 {
            let color = splat[0].as_dvec3() * Basis::FACTORS[0] + 0.5;
            for (value, color) in result.iter_mut().zip(color.to_array()) {
                *value = (Activation::Sigmoid.invert(color) / Basis::FACTORS[0]) as f32;
            }
            return result;
        }
        for (y, weight) in &self.0 {
            let sum: DVec3 = splat.iter().zip(y).map(|(k, y)| k.as_dvec3() * *y).sum();
            for channel in 0..3 {
                let radiance = (sum[channel] + 0.5).clamp(MARGIN, 1.0 - MARGIN);
                let inverse = Activation::Sigmoid.invert(radiance);
                for (value, y) in result[channel * count..][..count].iter_mut().zip(y) {
                    *value += (weight * inverse * y) as f32;
                }
            }
        }
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Colors look the same in every direction, as far as harmonics of this degree can.
    #[test]
    fn converted_colors_look_the_same() {
        let directions = Directions::new();
        for degree in 0..3 {
            let count = (degree + 1usize).pow(2);
            let splat: Vec<Vec3> = (0..count)
                .map(|k| 0.12 * Vec3::new((k as f32).sin(), (2.3 * k as f32).cos(), 0.3 - k as f32 * 0.1))
                .collect();
            let field = directions.convert(&splat);
            for step in 0..40 {
                let at = f64::from(step);
                let direction = DVec3::new(at.sin(), (1.7 * at).cos(), (0.9 * at).sin()).normalize();
                let y = Basis::Sh9.evaluate(direction);
                for channel in 0..3 {
                    let expected: f64 = splat.iter().zip(&y).map(|(k, y)| f64::from(k[channel]) * y).sum::<f64>() + 0.5;
                    let own = &field[channel * count..][..count];
                    let found = Activation::Sigmoid.apply(own.iter().zip(&y).map(|(k, y)| f64::from(*k) * y).sum());
                    assert!((found - expected).abs() < 0.02, "degree {degree}: {found} {expected}");
                }
            }
        }
    }
}
