//! Lenses: mapping directions to points of the picture, and back.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

/// The distortion of a lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distortion {
    /// No distortion.
    None,
    /// OpenCV's models: a polynomial in the squared radius, in its rational model divided by another.
    Radial {
        /// The coefficients of the polynomial: k1 to k4, or of the rational model, k1 to k3 and 0.
        radial: [f64; 4],
        /// Those of the divisor: zeros, or of the rational model, k4 to k6.
        divisor: [f64; 3],
        /// p1 and p2.
        tangential: [f64; 2],
    },
    /// OpenCV's fisheye model: k1 to k4 of a polynomial in the squared angle from the axis.
    Fisheye([f64; 4]),
}

/// The intrinsics of a camera, in pixels. Pixel centers are at +0.5.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Focal lengths.
    pub focal: DVec2,
    /// Where the optical axis meets the picture, from its top left corner.
    pub center: DVec2,
    /// The distortion.
    pub distortion: Distortion,
}

impl Lens {
    /// Returns where a direction meets the picture, or `None` if it is behind the lens. Directions have x to the right,
    /// y down and z forward.
    pub fn project(&self, direction: DVec3) -> Option<DVec2> {
        let bent = match self.distortion {
            Distortion::Fisheye(k) => {
                let radius = direction.truncate().length();
                let angle = radius.atan2(direction.z);
                if radius < 1e-12 {
                    if direction.z <= 0.0 {
                        return None;
                    }
                    DVec2::ZERO
                } else {
                    direction.truncate() * (fisheye(k, angle) / radius)
                }
            }
            _ if direction.z <= 1e-9 => return None,
            Distortion::None => direction.truncate() / direction.z,
            Distortion::Radial { radial, divisor, tangential } => {
                bend(radial, divisor, tangential, direction.truncate() / direction.z)
            }
        };
        Some(self.center + self.focal * bent)
    }

    /// Returns the direction, not normalized, that meets the picture at `point`, or `None` if there is none: some
    /// distortions are not defined everywhere, and fold over outside.
    pub fn unproject(&self, point: DVec2) -> Option<DVec3> {
        let bent = (point - self.center) / self.focal;
        match self.distortion {
            Distortion::None => Some(bent.extend(1.0)),
            Distortion::Radial { radial, divisor, tangential } => {
                let straight = solve(bent, |at| bend(radial, divisor, tangential, at))?;
                Some(straight.extend(1.0))
            }
            Distortion::Fisheye(k) => {
                let radius = bent.length();
                if radius < 1e-12 {
                    return Some(DVec3::Z);
                }
                let angle = angle_of(k, radius)?;
                Some((bent * (angle.sin() / radius)).extend(angle.cos()))
            }
        }
    }

    /// Returns the lens for a picture downscaled by `factor`.
    pub fn downscaled(self, factor: f64) -> Self {
        self.scaled(DVec2::splat(factor.recip()))
    }

    /// Returns the lens for a picture that is so many times as wide and as high.
    pub(super) fn scaled(mut self, scale: DVec2) -> Self {
        self.focal *= scale;
        self.center *= scale;
        self
    }
}

fn bend(radial: [f64; 4], divisor: [f64; 3], [p1, p2]: [f64; 2], at: DVec2) -> DVec2 {
    let r2 = at.length_squared();
    let polynomial = |terms: &[f64]| 1.0 + terms.iter().rev().fold(0.0, |sum, term| r2 * (term + sum));
    let scale = polynomial(&radial) / polynomial(&divisor);
    let DVec2 { x, y } = at;
    scale * at + DVec2::new(2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x), p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y)
}

fn fisheye([k1, k2, k3, k4]: [f64; 4], angle: f64) -> f64 {
    let a2 = angle * angle;
    angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))))
}

/// Finds the angle that [`fisheye`] maps to `radius`, by bisection up to where the radius rises no further. Returns `None`
/// if there is none.
fn angle_of(k: [f64; 4], radius: f64) -> Option<f64> {
    const STEPS: i32 = 256;
    let (mut low, mut high) = (0.0, 0.0);
    for step in 1..=STEPS {
        high = PI * f64::from(step) / f64::from(STEPS);
        let reached = fisheye(k, high);
        if reached >= radius || reached <= fisheye(k, low) {
            break;
        }
        low = high;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if fisheye(k, middle) < radius {
            low = middle;
        } else {
            high = middle;
        }
    }
    ((fisheye(k, high) - radius).abs() < 1e-9).then_some(high)
}

/// Finds the point that `bend` maps to `bent`. Returns `None` if there is none, or if the picture folds over between the
/// center and that point: beyond a fold, the polynomials say nothing about the lens.
fn solve(bent: DVec2, bend: impl Fn(DVec2) -> DVec2) -> Option<DVec2> {
    /// The way from the center if the shortcut leads beyond a fold.
    const STEPS: i32 = 64;
    /// The parts of the way at which a fold would show.
    const PARTS: i32 = 16;
    let is_unfolded = |at: &DVec2| {
        let mut parts = (1..=PARTS).map(|part| f64::from(part) / f64::from(PARTS));
        at.dot(bent) >= 0.0 && parts.all(|part| determinant(slopes(part * *at, &bend)) > 0.0)
    };
    let in_steps = || {
        let mut steps = (1..=STEPS).map(|step| f64::from(step) / f64::from(STEPS));
        steps.try_fold(DVec2::ZERO, |at, step| newton(at, step * bent, &bend))
    };
    newton(bent, bent, &bend).filter(is_unfolded).or_else(|| in_steps().filter(is_unfolded))
}

/// Finds a point that `bend` maps to `bent`, by Newton's method, starting from `at`. Returns `None` if it does not
/// converge.
fn newton(mut at: DVec2, bent: DVec2, bend: impl Fn(DVec2) -> DVec2) -> Option<DVec2> {
    for _ in 0..50 {
        let error = bend(at) - bent;
        if error.length_squared() < 1e-20 {
            return Some(at);
        }
        let [across, down] = slopes(at, &bend);
        let determinant = determinant([across, down]);
        if determinant.abs() < 1e-9 {
            return None;
        }
        at -= DVec2::new(error.perp_dot(down), across.perp_dot(error)) / determinant;
    }
    None
}

/// Returns the derivatives of `bend` along x and y.
fn slopes(at: DVec2, bend: impl Fn(DVec2) -> DVec2) -> [DVec2; 2] {
    const STEP: f64 = 1e-6;
    [DVec2::X, DVec2::Y].map(|axis| (bend(at + STEP * axis) - bend(at - STEP * axis)) / (2.0 * STEP))
}

fn determinant([across, down]: [DVec2; 2]) -> f64 {
    across.perp_dot(down)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// A point of the picture is where its direction meets the picture, for every kind of lens.
        #[test]
        fn directions_meet_the_picture_where_they_came_from(
            x in 0.0..640.0, y in 0.0..480.0,
            k in prop::array::uniform4(-0.04..0.08), p in prop::array::uniform2(-0.01..0.01),
        ) {
            let (rational, by) = ([k[0], k[1], k[2], 0.0], [k[3], 0.5 * k[0], 0.5 * k[1]]);
            for distortion in [
                Distortion::None,
                Distortion::Radial { radial: k, divisor: [0.0; 3], tangential: p },
                Distortion::Radial { radial: rational, divisor: by, tangential: p },
                Distortion::Fisheye(k.map(|k| k / 4.0)),
            ] {
                let lens = Lens { focal: DVec2::new(420.0, 400.0), center: DVec2::new(310.0, 250.0), distortion };
                let direction = lens.unproject(DVec2::new(x, y)).unwrap();
                let back = lens.project(direction).unwrap();
                prop_assert!((back - DVec2::new(x, y)).length() < 1e-4, "{distortion:?}: {back}");
            }
        }
    }

    /// Wherever the radius of a lens rises no further, nothing is known beyond, and everything is known within.
    #[test]
    fn nothing_is_beyond_a_fold() {
        let none = [0.0; 2];
        for (distortion, largest) in [
            // 1 - 0.9 r^2 is 0 at 1.054, whose radius is two thirds of that.
            (Distortion::Radial { radial: [-0.3, 0.0, 0.0, 0.0], divisor: [0.0; 3], tangential: none }, 0.70273),
            // Rises up to 1, falls to 1.414, and rises again.
            (Distortion::Radial { radial: [-0.5, 0.1, 0.0, 0.0], divisor: [0.0; 3], tangential: none }, 0.6),
            (Distortion::Fisheye([-0.3, 0.0, 0.0, 0.0]), 0.70273),
            // Points are farther from the center in the picture than before it is bent.
            (Distortion::Radial { radial: [1.0, -0.5, 0.0, 0.0], divisor: [0.0; 3], tangential: none }, 1.68474),
            (Distortion::Fisheye([0.4, -0.3, 0.1, -0.01]), 3.92255),
        ] {
            let lens = Lens { focal: DVec2::ONE, center: DVec2::ZERO, distortion };
            for step in 1..5_000 {
                let (angle, radius) = (0.7 * f64::from(step), 1e-3 * (f64::from(step) + 0.4));
                let point = radius * DVec2::from_angle(angle);
                let found = lens.unproject(point);
                let is_near = (radius - largest).abs() < 2e-3;
                assert!(is_near || found.is_some() == (radius < largest), "{distortion:?}: {radius}");
                assert!(found.is_none_or(|direction| direction.truncate().dot(point) > 0.0));
            }
        }
    }

    /// OpenCV's `projectPoints` with f = 100, c = 50, k = (0.1, -0.05, 0.02), p = (0.01, -0.02) at (0.3, -0.2, 1): by
    /// hand.
    #[test]
    fn distortion_is_that_of_opencv() {
        let lens = |divisor| Lens {
            focal: DVec2::splat(100.0),
            center: DVec2::splat(50.0),
            distortion: Distortion::Radial { radial: [0.1, -0.05, 0.02, 0.0], divisor, tangential: [0.01, -0.02] },
        };
        let (x, y, r2) = (0.3, -0.2, 0.13f64);
        let radial = 1.0 + 0.1 * r2 - 0.05 * r2 * r2 + 0.02 * r2 * r2 * r2;
        let expected = DVec2::new(
            50.0 + 100.0 * (x * radial + 2.0 * 0.01 * x * y - 0.02 * (r2 + 2.0 * x * x)),
            50.0 + 100.0 * (y * radial + 0.01 * (r2 + 2.0 * y * y) + 2.0 * -0.02 * x * y),
        );
        let found = lens([0.0; 3]).project(DVec3::new(0.6, -0.4, 2.0)).unwrap();
        assert!((found - expected).length() < 1e-12, "{found} {expected}");
        // With k4 to k6 of 0.3, -0.1 and 0.05.
        let divisor = 1.0 + 0.3 * r2 - 0.1 * r2 * r2 + 0.05 * r2 * r2 * r2;
        let expected = expected + 100.0 * (radial / divisor - radial) * DVec2::new(x, y);
        let found = lens([0.3, -0.1, 0.05]).project(DVec3::new(0.6, -0.4, 2.0)).unwrap();
        assert!((found - expected).length() < 1e-12, "{found} {expected}");
    }
}
