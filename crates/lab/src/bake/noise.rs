//! Hashed noise: the same numbers on every machine, without a generator's state.

use glam::{DVec3, I64Vec3};

/// Returns a number in [0, 1) that depends on every bit of the position and the seed.
pub fn hash(place: I64Vec3, seed: u64) -> f64 {
    let mut bits = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    for value in place.to_array() {
        bits = (bits ^ value as u64).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits = (bits ^ (bits >> 29)).wrapping_mul(0x94D0_49BB_1331_11EB);
        bits ^= bits >> 32;
    }
    (bits >> 11) as f64 / (1u64 << 53) as f64
}

/// Returns the `index`th number in [0, 1) of the sequence `seed`.
pub fn random(index: usize, seed: u64) -> f64 {
    hash(I64Vec3::new(index as i64, 0, 0), seed)
}

/// Returns smooth noise in [-1, 1] whose features are about one unit wide.
pub fn noise(position: DVec3, seed: u64) -> f64 {
    let corner = position.floor();
    let blend = (position - corner) * (position - corner) * (3.0 - 2.0 * (position - corner));
    let corner = corner.as_i64vec3();
    let mut sum = 0.0;
    for index in 0..8 {
        let offset = I64Vec3::new(index >> 2, (index >> 1) & 1, index & 1);
        let weight = (offset.as_dvec3() * blend + (1 - offset).as_dvec3() * (1.0 - blend)).element_product();
        sum += weight * hash(corner + offset, seed);
    }
    2.0 * sum - 1.0
}

/// Returns a loud color: full saturation, any hue.
pub fn loud(place: I64Vec3, seed: u64) -> DVec3 {
    let hue = 6.0 * hash(place, seed);
    let channel = |shift: f64| (((hue + shift).rem_euclid(6.0) - 3.0).abs() - 1.0).clamp(0.0, 1.0);
    DVec3::new(channel(0.0), channel(4.0), channel(2.0))
}
