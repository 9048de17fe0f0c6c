//! The density that looks like a Gaussian of a capture.
//!
//! A splat is drawn flat: across the image, its opacity is `a g`, with its opacity `a` and a Gaussian `g` of height 1.
//! Its optical depth is therefore `-ln(1 - a g) = sum over k of (a g)^k / k`, a sum of ever narrower Gaussians. Each of
//! them is the shadow of a Gaussian in space, which has the same shape along the ray. In the ellipsoid's own axes and
//! widths, the density at the distance `r` from its center is thus
//!
//! `sum over k of a^k / k sqrt(k / 2 pi) e^(-k r^2 / 2) = Li_1/2(a e^(-r^2 / 2)) / sqrt(2 pi)`
//!
//! for a ray that crosses the ellipsoid over a length of 1. The opacity `a` of a splat is the same in all directions,
//! but the optical depth of an ellipsoid is larger along its longer axes. The density is therefore scaled for a length
//! in between: see [`area`], and [`areas`](super::areas).

use glam::DVec3;

use crate::exponential::rounded;

/// Entries of the table.
const ENTRIES: usize = 2048;
/// Highest opacity of a Gaussian, as when it is drawn.
pub const MOST_OPACITY: f64 = 0.99;

/// The polylogarithm of order 1/2, divided by `sqrt(2 pi)`, by a table: its value in the middle of an entry, and by how
/// much it grows over one.
pub struct Profile([[f32; 2]; ENTRIES]);

impl Profile {
    pub fn new() -> Self {
        let value = |place: f64| {
            let x = MOST_OPACITY * place / (ENTRIES - 1) as f64;
            polylogarithm(0.5, x) / std::f64::consts::TAU.sqrt()
        };
        Self(std::array::from_fn(|entry| {
            let place = entry as f64;
            [value(place) as f32, (value(place + 0.5) - value(place - 0.5)) as f32]
        }))
    }

    /// Returns the density at the distance where a ray would meet the opacity `x`, at most [`MOST_OPACITY`], for an
    /// ellipsoid of width 1.
    #[inline(always)]
    pub fn density(&self, x: f32) -> f32 {
        let (entry, rest) = rounded(x * ((ENTRIES - 1) as f32 / MOST_OPACITY as f32));
        let [value, slope] = self.0[entry as usize % ENTRIES];
        value + slope * rest
    }
}

/// Sums `x^k / k^order` for x between -1 and 1.
fn polylogarithm(order: f64, x: f64) -> f64 {
    let (mut sum, mut power) = (0.0, 1.0);
    for k in 1..4000 {
        power *= x;
        sum += power / f64::from(k).powf(order);
        if power.abs() < 1e-9 {
            break;
        }
    }
    sum
}

/// Returns the apparent area of an ellipsoid, in multiples of pi: the mean over all directions, weighted by area, since
/// more rays meet it where its area is large. `widths` are its half-widths.
pub fn area(widths: DVec3) -> f64 {
    let faces = DVec3::new(widths.y * widths.z, widths.x * widths.z, widths.x * widths.y);
    // The mean of the squares is exact. That of the areas is a quarter of the surface, by Thomsen's formula.
    let squares = faces.length_squared() / 3.0;
    const POWER: f64 = 1.6075;
    let powers = faces.to_array().map(|face| face.powf(POWER));
    let mean = (powers.iter().sum::<f64>() / 3.0).powf(1.0 / POWER);
    if mean > 0.0 { squares / mean } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Along a ray at any distance from the center, the density adds up to the optical depth of the splat.
    #[test]
    fn densities_add_up_to_the_opacity_of_the_splat() {
        let profile = Profile::new();
        for opacity in [0.01, 0.2, 0.6, 0.9, 0.98] {
            for distance in [0.0, 0.5, 1.0, 2.0] {
                let step = 0.002;
                let depth: f64 = (-4000..4000)
                    .map(|at| {
                        let along = (f64::from(at) + 0.5) * step;
                        let x = opacity * (-0.5 * (distance * distance + along * along)).exp();
                        step * f64::from(profile.density(x as f32))
                    })
                    .sum();
                let expected = -(1.0 - opacity * (-0.5 * distance * distance).exp()).ln();
                assert!((depth / expected - 1.0).abs() < 2e-3, "{opacity} {distance}: {depth} {expected}");
            }
        }
    }

    /// A ball shows its cross section in every direction, and a disc two thirds of its face.
    #[test]
    fn areas_are_those_of_balls_and_discs() {
        assert!((area(DVec3::splat(2.0)) - 4.0).abs() < 1e-9);
        let disc = area(DVec3::new(3.0, 1e-9, 3.0));
        assert!((disc / 6.0 - 1.0).abs() < 0.03, "{disc}");
        assert_eq!(area(DVec3::ZERO), 0.0);
    }
}
