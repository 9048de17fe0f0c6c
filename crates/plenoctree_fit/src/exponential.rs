//! Exponentials that are the same on every machine, and that compilers turn into vector instructions.

#[cfg(feature = "fit")]
use glam::Vec4;

/// Coefficients of a polynomial for `2^x`, -0.5 <= x <= 0.5, from the highest power, with a relative error below 2e-7.
const POWER_OF_TWO: [f32; 6] = [0.001_326_474_2, 0.009_671_518, 0.055_507_336, 0.240_222_42, 0.693_146_94, 1.0];
/// Adding it to a small number rounds that to a whole one, which is in the lowest bits of the sum.
const ROUNDING: f32 = (3 << 22) as f32;

/// Returns the whole number that is nearest to a small one, in its lowest bits, and the rest. Converts nothing to
/// integers, which compilers turn into vector instructions only if nothing checks the range.
#[inline(always)]
pub fn rounded(x: f32) -> (u32, f32) {
    let sum = x + ROUNDING;
    (sum.to_bits(), x - (sum - ROUNDING))
}

/// Returns `e^-x` for x >= 0, with a relative error below 1e-5, and below 1e-6 for x < 4. It is at most 1.
#[inline(always)]
pub fn exp_minus(x: f32) -> f32 {
    power_of_two(x.min(80.0) * -std::f32::consts::LOG2_E)
}

/// Returns `e^x` for x between -80 and 80, as accurately.
#[cfg(feature = "splat")]
#[inline(always)]
pub fn exp(x: f32) -> f32 {
    power_of_two(x.clamp(-80.0, 80.0) * std::f32::consts::LOG2_E)
}

#[inline(always)]
fn power_of_two(x: f32) -> f32 {
    let (whole, rest) = rounded(x);
    let power = POWER_OF_TWO.iter().fold(0.0, |sum, k| sum * rest + k);
    // Adds the whole number to the exponent.
    f32::from_bits(power.to_bits().wrapping_add(whole << 23))
}

/// Returns `1 / (1 + e^-x)` of each element, with an error below 1e-6.
#[cfg(feature = "fit")]
#[inline]
pub fn sigmoid(x: Vec4) -> Vec4 {
    let [a, b, c, d] = x.abs().to_array();
    let small = Vec4::new(exp_minus(a), exp_minus(b), exp_minus(c), exp_minus(d));
    let high = (Vec4::ONE + small).recip();
    Vec4::select(x.cmpge(Vec4::ZERO), high, small * high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponentials_are_accurate() {
        for step in 0..70_000 {
            let x = step as f32 * 1e-3;
            let exact = (-f64::from(x)).exp();
            assert!((f64::from(exp_minus(x)) / exact - 1.0).abs() < 8e-6, "{x}: {}", exp_minus(x));
        }
        assert!(exp_minus(1e30) < 1e-30);
    }

    #[cfg(feature = "splat")]
    #[test]
    fn exponentials_of_either_sign_are_accurate() {
        for step in -80_000..80_000 {
            let x = step as f32 * 1e-3;
            let exact = f64::from(x).exp();
            assert!((f64::from(exp(x)) / exact - 1.0).abs() < 8e-6, "{x}: {}", exp(x));
        }
        assert!(exp(-1e30) < 1e-30 && exp(1e30) > 1e30);
    }

    #[cfg(feature = "fit")]
    #[test]
    fn sigmoids_are_accurate() {
        for step in -70_000..70_000 {
            let x = step as f32 * 1e-3;
            let exact = 1.0 / (1.0 + (-f64::from(x)).exp());
            assert!((f64::from(sigmoid(Vec4::splat(x)).x) - exact).abs() < 2e-6, "{x}");
        }
    }
}
