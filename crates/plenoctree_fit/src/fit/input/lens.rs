//! Lenses: mapping directions to points of the picture, and back.

use glam::{DVec2, DVec3};

/// The distortion of a lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distortion {
    /// No distortion.
    None,
    /// OpenCV's model: `radial` are k1 to k4 of a polynomial in the squared radius, `tangential` p1 and p2.
    Radial {
        /// k1 to k4.
        radial: [f64; 4],
        /// p1 and p2.
        tangential: [f64; 2],
    },
    /// OpenCV's rational model: a polynomial in the squared radius, divided by another.
    Rational {
        /// k1 to k6.
        radial: [f64; 6],
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
            Distortion::Radial { radial, tangential } => bend(radial, tangential, direction.truncate() / direction.z),
            Distortion::Rational { radial, tangential } => {
                bend_rational(radial, tangential, direction.truncate() / direction.z)
            }
        };
        Some(self.center + self.focal * bent)
    }

    /// Returns the direction, not normalized, that meets the picture at `point`, or `None` if there is none: some
    /// distortions are not defined everywhere.
    pub fn unproject(&self, point: DVec2) -> Option<DVec3> {
        let bent = (point - self.center) / self.focal;
        match self.distortion {
            Distortion::None => Some(bent.extend(1.0)),
            Distortion::Radial { radial, tangential } => {
                let straight = solve(bent, |at| bend(radial, tangential, at))?;
                Some(straight.extend(1.0))
            }
            Distortion::Rational { radial, tangential } => {
                let straight = solve(bent, |at| bend_rational(radial, tangential, at))?;
                Some(straight.extend(1.0))
            }
            Distortion::Fisheye(k) => {
                let radius = bent.length();
                if radius < 1e-12 {
                    return Some(DVec3::Z);
                }
                let mut angle = radius;
                for _ in 0..30 {
                    let slope = (fisheye(k, angle + 1e-6) - fisheye(k, angle - 1e-6)) / 2e-6;
                    angle = (angle - (fisheye(k, angle) - radius) / slope).clamp(0.0, std::f64::consts::PI);
                }
                let found = (fisheye(k, angle) - radius).abs() < 1e-7;
                found.then(|| (bent * (angle.sin() / radius)).extend(angle.cos()))
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

fn bend([k1, k2, k3, k4]: [f64; 4], tangential: [f64; 2], at: DVec2) -> DVec2 {
    let r2 = at.length_squared();
    shifted(1.0 + r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * k4))), tangential, at)
}

fn bend_rational([k1, k2, k3, k4, k5, k6]: [f64; 6], tangential: [f64; 2], at: DVec2) -> DVec2 {
    let r2 = at.length_squared();
    let polynomial = |[a, b, c]: [f64; 3]| 1.0 + r2 * (a + r2 * (b + r2 * c));
    shifted(polynomial([k1, k2, k3]) / polynomial([k4, k5, k6]), tangential, at)
}

/// Scales a point, and adds the tangential distortion.
fn shifted(radial: f64, [p1, p2]: [f64; 2], at: DVec2) -> DVec2 {
    let r2 = at.length_squared();
    let DVec2 { x, y } = at;
    radial * at + DVec2::new(2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x), p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y)
}

fn fisheye([k1, k2, k3, k4]: [f64; 4], angle: f64) -> f64 {
    let a2 = angle * angle;
    angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))))
}

/// Finds the point that `bend` maps to `bent`, by Newton's method. Returns `None` if it does not converge.
fn solve(bent: DVec2, bend: impl Fn(DVec2) -> DVec2) -> Option<DVec2> {
    const STEP: f64 = 1e-6;
    let mut at = bent;
    for _ in 0..50 {
        let error = bend(at) - bent;
        if error.length_squared() < 1e-20 {
            return Some(at);
        }
        let across = (bend(at + STEP * DVec2::X) - bend(at - STEP * DVec2::X)) / (2.0 * STEP);
        let down = (bend(at + STEP * DVec2::Y) - bend(at - STEP * DVec2::Y)) / (2.0 * STEP);
        let determinant = across.perp_dot(down);
        if determinant.abs() < 1e-9 {
            return None;
        }
        at -= DVec2::new(error.perp_dot(down), across.perp_dot(error)) / determinant;
    }
    None
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
            let rational = [k[0], k[1], k[2], k[3], 0.5 * k[0], 0.5 * k[1]];
            for distortion in [
                Distortion::None,
                Distortion::Radial { radial: k, tangential: p },
                Distortion::Rational { radial: rational, tangential: p },
                Distortion::Fisheye(k.map(|k| k / 4.0)),
            ] {
                let lens = Lens { focal: DVec2::new(420.0, 400.0), center: DVec2::new(310.0, 250.0), distortion };
                let direction = lens.unproject(DVec2::new(x, y)).unwrap();
                let back = lens.project(direction).unwrap();
                prop_assert!((back - DVec2::new(x, y)).length() < 1e-4, "{distortion:?}: {back}");
            }
        }
    }

    /// OpenCV's `projectPoints` with f = 100, c = 50, k = (0.1, -0.05, 0.02), p = (0.01, -0.02) at (0.3, -0.2, 1): by
    /// hand.
    #[test]
    fn distortion_is_that_of_opencv() {
        let lens = Lens {
            focal: DVec2::splat(100.0),
            center: DVec2::splat(50.0),
            distortion: Distortion::Radial { radial: [0.1, -0.05, 0.02, 0.0], tangential: [0.01, -0.02] },
        };
        let (x, y, r2) = (0.3, -0.2, 0.13f64);
        let radial = 1.0 + 0.1 * r2 - 0.05 * r2 * r2 + 0.02 * r2 * r2 * r2;
        let expected = DVec2::new(
            50.0 + 100.0 * (x * radial + 2.0 * 0.01 * x * y - 0.02 * (r2 + 2.0 * x * x)),
            50.0 + 100.0 * (y * radial + 0.01 * (r2 + 2.0 * y * y) + 2.0 * -0.02 * x * y),
        );
        let found = lens.project(DVec3::new(0.6, -0.4, 2.0)).unwrap();
        assert!((found - expected).length() < 1e-12, "{found} {expected}");
        // With k4 to k6 of 0.3, -0.1 and 0.05.
        let distortion =
            Distortion::Rational { radial: [0.1, -0.05, 0.02, 0.3, -0.1, 0.05], tangential: [0.01, -0.02] };
        let divisor = 1.0 + 0.3 * r2 - 0.1 * r2 * r2 + 0.05 * r2 * r2 * r2;
        let expected = expected + 100.0 * (radial / divisor - radial) * DVec2::new(x, y);
        let found = Lens { distortion, ..lens }.project(DVec3::new(0.6, -0.4, 2.0)).unwrap();
        assert!((found - expected).length() < 1e-12, "{found} {expected}");
    }
}
