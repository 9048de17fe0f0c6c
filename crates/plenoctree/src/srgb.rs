//! The encoding of sRGB, in float64. Negative channels are encoded like positive ones.

/// Decodes a channel of encoded sRGB to linear light.
pub fn decode(encoded: f64) -> f64 {
    let size = encoded.abs();
    let linear = if size <= 0.04045 { size / 12.92 } else { ((size + 0.055) / 1.055).powf(2.4) };
    linear.copysign(encoded)
}

/// Encodes a channel of linear light as sRGB: the inverse of [`decode`].
pub fn encode(linear: f64) -> f64 {
    let size = linear.abs();
    let encoded = if size <= 0.0031308 { 12.92 * size } else { 1.055 * size.powf(1.0 / 2.4) - 0.055 };
    encoded.copysign(linear)
}
