//! Oklab, a perceptual space: lightness, hue and chroma of colors.

use glam::{DMat3, DVec2, DVec3, swizzles::Vec3Swizzles};

use crate::srgb::{decode, encode};

/// Chroma in Oklab above which a color has a visible hue.
pub(super) const CHROMATIC: f64 = 0.04;

/// Chroma in Oklab below which rounding decides on the hue.
const GRAY: f64 = 1e-6;

/// Converts linear sRGB to cone responses. The coefficients are those of Oklab's author, by columns.
const CONES_FROM_LINEAR: DMat3 = DMat3::from_cols_array(&[
    0.4122214708,
    0.2119034982,
    0.0883024619,
    0.5363325363,
    0.6806995451,
    0.2817188376,
    0.0514459929,
    0.1073969566,
    0.6299787005,
]);

/// Converts the cube roots of cone responses to Oklab.
const OKLAB_FROM_ROOTS: DMat3 = DMat3::from_cols_array(&[
    0.2104542553,
    1.9779984951,
    0.0259040371,
    0.7936177850,
    -2.4285922050,
    0.7827717662,
    -0.0040720468,
    0.4505937099,
    -0.8086757660,
]);

/// Returns a and b in Oklab of a color in encoded sRGB.
pub(super) fn chroma(encoded: DVec3) -> DVec2 {
    oklab(encoded).yz()
}

/// Returns L, a and b in Oklab of a color in encoded sRGB.
pub(super) fn oklab(encoded: DVec3) -> DVec3 {
    oklab_of_linear(DVec3::from(encoded.to_array().map(decode)))
}

/// Returns a and b in Oklab of a color in linear light.
pub(super) fn chroma_of_linear(linear: DVec3) -> DVec2 {
    oklab_of_linear(linear).yz()
}

fn oklab_of_linear(linear: DVec3) -> DVec3 {
    OKLAB_FROM_ROOTS * DVec3::from((CONES_FROM_LINEAR * linear).to_array().map(f64::cbrt))
}

/// Returns the color in encoded sRGB of L, a and b in Oklab. Its channels may be outside [0, 1].
pub(super) fn from_oklab(oklab: DVec3) -> DVec3 {
    linear_from_oklab(oklab).to_array().map(encode).into()
}

/// Returns the color in linear light of L, a and b in Oklab.
pub(super) fn linear_from_oklab(oklab: DVec3) -> DVec3 {
    let roots = OKLAB_FROM_ROOTS.inverse() * oklab;
    CONES_FROM_LINEAR.inverse() * (roots * roots * roots)
}

/// Returns whether the hue of `shown` is more than 45 degrees off that of `color`, both a and b in Oklab. The hue of an
/// exact gray is off.
pub(super) fn is_hue_off(color: DVec2, shown: DVec2) -> bool {
    let [before, after] = [color.length(), shown.length()];
    after < GRAY || color.dot(shown) < std::f64::consts::FRAC_1_SQRT_2 * before * after
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Colors survive the way to Oklab and back, even outside the cube.
        #[test]
        fn oklab_is_invertible(color in prop::array::uniform3(-0.5..1.5f64)) {
            let color = DVec3::from(color);
            prop_assert!(from_oklab(oklab(color)).distance(color) < 1e-6, "{color}");
        }

        /// Dimming the light scales all of Oklab: what makes ramps of one material straight lines to black.
        #[test]
        fn less_light_scales_oklab(color in prop::array::uniform3(0.05..1.0f64), light in 0.1..1.0f64) {
            let lit = DVec3::from(color.map(|c| encode(light * decode(c))));
            prop_assert!(oklab(lit).distance(light.cbrt() * oklab(color.into())) < 1e-9);
        }
    }

    #[test]
    fn white_and_gray_have_no_chroma() {
        assert!((oklab(DVec3::ONE) - DVec3::X).length() < 1e-6);
        assert!(chroma(DVec3::splat(0.5)).length() < 1e-6);
    }
}
