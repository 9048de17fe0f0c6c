//! Grays without a tint.

use glam::{DVec3, swizzles::Vec3Swizzles};

/// Chromas in Oklab from which on a tone begins to be colorful, and from which on it is no gray at all.
const COLORFUL: (f64, f64) = (0.02, 0.05);
/// The chroma of a gray is halved if it is this many standard deviations of the a and b of its members.
const DEVIATIONS: f64 = 2.0;

/// Returns the color in Oklab of a tone, given the mean of its members and the variances of their a and b together.
/// Grays lose the tint that their members do not share. Flat colors keep theirs, however faint.
pub(super) fn neutral(mean: DVec3, variance: f64) -> DVec3 {
    let square = mean.yz().length_squared();
    let spread = DEVIATIONS * DEVIATIONS * variance;
    if square == 0.0 || spread <= 0.0 {
        return mean;
    }
    let shared = square / (square + spread);
    let colorful = ((square.sqrt() - COLORFUL.0) / (COLORFUL.1 - COLORFUL.0)).clamp(0.0, 1.0);
    let colorful = colorful * colorful * (3.0 - 2.0 * colorful);
    let kept = shared + (1.0 - shared) * colorful;
    mean * DVec3::new(1.0, kept, kept)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// The lightness and the hue stay, chroma never grows, and nothing jumps. Vivid and flat colors stay as they
        /// are.
        #[test]
        fn grays_lose_tints(lightness in 0.0..1.0f64, hue in 0.0..6.3f64, chroma in 0.0..0.3f64, deviation in 0.0..0.05f64) {
            let at = |chroma: f64| DVec3::new(lightness, chroma * hue.cos(), chroma * hue.sin());
            let kept = |chroma: f64| neutral(at(chroma), deviation * deviation);
            let found = kept(chroma);
            prop_assert!(found.x == lightness && found.yz().length() <= chroma + 1e-12);
            prop_assert!(found.yz().perp_dot(at(chroma).yz()).abs() < 1e-12);
            prop_assert!(chroma < COLORFUL.1 || found == at(chroma));
            prop_assert_eq!(neutral(at(chroma), 0.0), at(chroma));
            prop_assert!(kept(chroma + 1e-4).distance(found) < 1e-3);
        }
    }

    /// A tint of a quarter of what its members scatter is gone, and one of eight times as much stays.
    #[test]
    fn what_members_share_stays() {
        let chroma = |of: f64, deviation: f64| neutral(DVec3::new(0.5, of, 0.0), deviation * deviation).y;
        assert!(chroma(0.005, 0.02) < 1e-4);
        assert!(chroma(0.016, 0.002) > 0.9 * 0.016);
    }
}
