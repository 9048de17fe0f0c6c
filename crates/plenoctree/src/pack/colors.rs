//! Rounds the coefficients of the constant function.

use crate::{
    field::{Basis, PlenOctree},
    sampling::Seen,
};

/// Returns the coefficients of the constant function of every leaf, corrected so that its mean visible color stays what
/// it was before the other coefficients became rows of a codebook.
pub(super) fn corrected(field: &PlenOctree, seen: &[Seen], rows: &[u16], table: &[i16], step: f32) -> Vec<[f32; 3]> {
    let others = field.basis().functions() - 1;
    let of_leaf = |(leaf, seen): (usize, &Seen)| {
        std::array::from_fn(|channel| {
            let (constant, own) = field.stored().channel(field.basis(), leaf, channel);
            let first = rows.get(leaf).map_or(0, |row| (usize::from(*row) * 3 + channel) * others);
            let shared = &table[first..][..others];
            let errors = own.iter().zip(shared).zip(&seen.basis);
            let added: f32 = errors.map(|((own, shared), y)| (own.to_f32() - f32::from(*shared) * step) * y).sum();
            constant.to_f32() + added / Basis::FACTORS[0] as f32
        })
    };
    seen.iter().enumerate().map(of_leaf).collect()
}

/// Rounds colors to multiples of `step`, as [`Quantized`](super::Quantized) holds them.
///
/// Colors are stored as differences from the leaf before, so a leaf's numbers are moved toward those of the leaf before as
/// long as that saves bits. `bits` is how many bits a step of an averagely visible channel is worth.
pub(super) fn quantize(constants: &[[f32; 3]], seen: &[Seen], step: f32, bits: f32) -> Vec<[i32; 3]> {
    let mut before = [0i32; 3];
    let of_leaf = |(rgb, seen): (&[f32; 3], &Seen)| {
        let [r, g, b] = rgb.map(|k| k / step);
        let wanted = [(r + 2.0 * g + b) / 4.0, (r - b) / 2.0, (2.0 * g - r - b) / 4.0];
        let [red, green, blue] = seen.channels;
        let weights = [red + green + blue, red + blue, red + green + blue];
        for ((before, wanted), weight) in before.iter_mut().zip(wanted).zip(weights) {
            *before = nearest(wanted, *before, weight * bits);
        }
        before
    };
    constants.iter().zip(seen).map(of_leaf).collect()
}

/// Returns the number with the least cost: squared distance from `wanted` times `scale`, plus bits for the difference from
/// `before`.
fn nearest(wanted: f32, before: i32, scale: f32) -> i32 {
    let difference = wanted - before as f32;
    let rounded = difference.round();
    let cost = |change: f32| {
        let bits = 2.0 * (1.0 + change.abs()).log2();
        scale * (difference - change).powi(2) + bits
    };
    let toward = rounded.signum();
    let choices = [rounded, rounded - toward, rounded - 2.0 * toward, (rounded / 2.0).trunc(), 0.0];
    let valid = |change: &f32| change * toward >= 0.0 && change.abs() <= rounded.abs();
    let best = choices.into_iter().filter(valid).min_by(|a, b| cost(*a).total_cmp(&cost(*b))).unwrap_or(rounded);
    before.wrapping_add(best as i32)
}
