//! Blending in Oklab, for palettes that change every frame. Processes three channels at once, which takes half as long
//! as Bevy's conversions.
//!
//! Oklab is a linear transform of the cube roots of the cone responses, so blending those roots blends in Oklab.

use bevy::{
    math::{Mat3A, Vec3A},
    prelude::*,
};

/// Converts linear sRGB to cone responses. The coefficients are those of Oklab's author.
const CONES_FROM_LINEAR: Mat3A = Mat3A::from_cols_array(&[
    0.41222146,
    0.2119035,
    0.08830246,
    0.53633255,
    0.6806995,
    0.28171885,
    0.051445995,
    0.10739696,
    0.6299787,
]);
/// Converts cone responses to linear sRGB.
const LINEAR_FROM_CONES: Mat3A = Mat3A::from_cols_array(&[
    4.0767417,
    -1.268438,
    -0.0041960863,
    -3.3077116,
    2.6097574,
    -0.7034186,
    0.23096994,
    -0.34131938,
    1.7076147,
]);

/// Blends two colors in encoded sRGB: returns `from` at `t` = 0 and `to` at `t` = 1. Channels may lie outside [0, 1];
/// the transfer function is extended to negative values as an odd function.
pub(super) fn mix(from: Srgba, to: Srgba, t: f32) -> Srgba {
    let roots = |color: Srgba| signed_root(CONES_FROM_LINEAR * decode(color.to_vec3().into()));
    let blend = roots(from).lerp(roots(to), t);
    let [red, green, blue] = encode(LINEAR_FROM_CONES * (blend * blend * blend)).to_array();
    Srgba::rgb(red, green, blue)
}

fn decode(encoded: Vec3A) -> Vec3A {
    let size = encoded.abs();
    // x^2.4 = (x * x^(1/5))^2
    let base = (size + 0.055) / 1.055;
    let half_power = base * root::<5>(base);
    Vec3A::select(size.cmple(Vec3A::splat(0.04045)), size / 12.92, half_power * half_power).copysign(encoded)
}

fn encode(linear: Vec3A) -> Vec3A {
    let size = linear.abs();
    // x^(1/2.4) = x^(5/12) = sqrt(x^(1/2) * x^(1/3))
    let power = sqrt(sqrt(size) * root::<3>(size));
    Vec3A::select(size.cmple(Vec3A::splat(0.0031308)), 12.92 * size, 1.055 * power - 0.055).copysign(linear)
}

fn signed_root(x: Vec3A) -> Vec3A {
    root::<3>(x.abs()).copysign(x)
}

/// Returns the `N`th root of each channel, to single precision. Channels must not be negative.
fn root<const N: i32>(x: Vec3A) -> Vec3A {
    // The bits of a float approximate its logarithm.
    let one = 1.0f32.to_bits();
    let guess = |x: f32| f32::from_bits(x.to_bits() / N as u32 + (one - one / N as u32));
    let mut root = Vec3A::from_array(x.to_array().map(guess));
    // Each step of Halley's method triples the number of correct digits. `MIN_POSITIVE` avoids dividing 0 by 0.
    let (minus, plus) = ((N - 1) as f32, (N + 1) as f32);
    for _ in 0..2 {
        let power = (1..N).fold(root, |power, _| power * root);
        root *= (minus * power + plus * x) / (plus * power + minus * x + f32::MIN_POSITIVE);
    }
    root
}

fn sqrt(x: Vec3A) -> Vec3A {
    Vec3A::from_array(x.to_array().map(f32::sqrt))
}

#[cfg(test)]
mod tests {
    use bevy::color::{Mix, Oklaba};
    use proptest::prelude::*;

    use super::*;

    fn color() -> impl Strategy<Value = Srgba> {
        prop::array::uniform3(0.0..=1.0f32).prop_map(|[r, g, b]| Srgba::rgb(r, g, b))
    }

    proptest! {
        #[test]
        fn blends_match_bevy(from in color(), to in color(), t in 0.0..=1.0f32) {
            let expected = Srgba::from(Oklaba::from(from).mix(&to.into(), t)).to_vec3();
            let found = mix(from, to, t).to_vec3();
            // Bevy encodes negative values differently.
            let visible = |color: Vec3| color.max(Vec3::ZERO);
            prop_assert!(visible(found).distance(visible(expected)) < 1e-4, "{found} for {expected}");
        }

        /// Blending a color with itself returns the color, even outside [0, 1].
        #[test]
        fn blending_equal_colors_changes_nothing(channels in prop::array::uniform3(-1.0..=2.0f32), t in 0.0..=1.0f32) {
            let color = Srgba::rgb(channels[0], channels[1], channels[2]);
            prop_assert!(mix(color, color, t).to_vec3().distance(color.to_vec3()) < 1e-3);
        }
    }
}
