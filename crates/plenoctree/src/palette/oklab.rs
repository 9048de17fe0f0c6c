//! The hue and chroma of colors, in Oklab.

use glam::{DVec2, DVec3};

/// Chroma in Oklab above which a color has a visible hue.
pub(super) const CHROMATIC: f64 = 0.04;

/// Chroma in Oklab below which rounding decides on the hue.
const GRAY: f64 = 1e-6;

/// Returns a and b in Oklab of a color in encoded sRGB.
pub(super) fn chroma(encoded: DVec3) -> DVec2 {
    chroma_of_linear(DVec3::from(encoded.to_array().map(decode)))
}

/// Decodes a channel of encoded sRGB to linear light.
pub(super) fn decode(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// Returns a and b in Oklab of a color in linear light.
pub(super) fn chroma_of_linear(linear: DVec3) -> DVec2 {
    let cone = |row: [f64; 3]| DVec3::from(row).dot(linear).cbrt();
    let cones = DVec3::new(
        cone([0.4122214708, 0.5363325363, 0.0514459929]),
        cone([0.2119034982, 0.6806995451, 0.1073969566]),
        cone([0.0883024619, 0.2817188376, 0.6299787005]),
    );
    DVec2::new(
        DVec3::new(1.9779984951, -2.4285922050, 0.4505937099).dot(cones),
        DVec3::new(0.0259040371, 0.7827717662, -0.8086757660).dot(cones),
    )
}

/// Returns whether the hue of `shown` is more than 45 degrees off that of `color`, both a and b in Oklab. The hue of an
/// exact gray is off.
pub(super) fn is_hue_off(color: DVec2, shown: DVec2) -> bool {
    let [before, after] = [color.length(), shown.length()];
    after < GRAY || color.dot(shown) < std::f64::consts::FRAC_1_SQRT_2 * before * after
}
