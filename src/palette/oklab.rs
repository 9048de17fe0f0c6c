//! Blends in Oklab, for palettes that change in every frame: three channels at once, and so in half the time that Bevy's
//! conversions take.
//!
//! Oklab is linear in the cube roots of what the three kinds of cones respond: to blend these is to blend in Oklab.

use bevy::{
    math::{Mat3A, Vec3A},
    prelude::*,
};

/// Responses of the cones to linear sRGB, with the coefficients of Oklab's author.
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
/// Linear sRGB of responses.
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

/// The color that is the share `t` of the way from one color to another. Encoded sRGB; out of [0, 1] the encoding goes
/// on as its own reflection in 0.
pub(super) fn mix(from: Srgba, to: Srgba, t: f32) -> Srgba {
    let roots = |color: Srgba| signed_root(CONES_FROM_LINEAR * decode(color.to_vec3().into()));
    let blend = roots(from).lerp(roots(to), t);
    let [red, green, blue] = encode(LINEAR_FROM_CONES * (blend * blend * blend)).to_array();
    Srgba::rgb(red, green, blue)
}

fn decode(encoded: Vec3A) -> Vec3A {
    let size = encoded.abs();
    // To the power of 2.4: of 12 / 5.
    let base = (size + 0.055) / 1.055;
    let half_power = base * root::<5>(base);
    Vec3A::select(size.cmple(Vec3A::splat(0.04045)), size / 12.92, half_power * half_power).copysign(encoded)
}

fn encode(linear: Vec3A) -> Vec3A {
    let size = linear.abs();
    // To the power of 1 / 2.4: of 5 / 12, which is half the sum of 1 / 2 and 1 / 3.
    let power = sqrt(sqrt(size) * root::<3>(size));
    Vec3A::select(size.cmple(Vec3A::splat(0.0031308)), 12.92 * size, 1.055 * power - 0.055).copysign(linear)
}

fn signed_root(x: Vec3A) -> Vec3A {
    root::<3>(x.abs()).copysign(x)
}

/// The `N`th root of numbers that are not negative, to single precision.
fn root<const N: i32>(x: Vec3A) -> Vec3A {
    // The bits of a float are nearly its logarithm.
    let one = 1.0f32.to_bits();
    let guess = |x: f32| f32::from_bits(x.to_bits() / N as u32 + (one - one / N as u32));
    let mut root = Vec3A::from_array(x.to_array().map(guess));
    // Halley's method triples the digits each time. The smallest number keeps 0 from being divided by 0.
    let (less, more) = ((N - 1) as f32, (N + 1) as f32);
    for _ in 0..2 {
        let power = (1..N).fold(root, |power, _| power * root);
        root *= (less * power + more * x) / (more * power + less * x + f32::MIN_POSITIVE);
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
        fn blends_are_those_of_bevy(from in color(), to in color(), t in 0.0..=1.0f32) {
            let expected = Srgba::from(Oklaba::from(from).mix(&to.into(), t)).to_vec3();
            let found = mix(from, to, t).to_vec3();
            // Below 0 the encodings differ.
            let visible = |color: Vec3| color.max(Vec3::ZERO);
            prop_assert!(visible(found).distance(visible(expected)) < 1e-4, "{found} for {expected}");
        }

        /// A blend of a color with itself is the color, of neon colors as well.
        #[test]
        fn there_and_back_is_the_same(channels in prop::array::uniform3(-1.0..=2.0f32), t in 0.0..=1.0f32) {
            let color = Srgba::rgb(channels[0], channels[1], channels[2]);
            prop_assert!(mix(color, color, t).to_vec3().distance(color.to_vec3()) < 1e-3);
        }
    }
}
