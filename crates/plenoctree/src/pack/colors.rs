//! Rounds the coefficients of the constant function.

use half::f16;

use super::metric::Metric;
use crate::file::COLOR_RANGES;
use crate::{
    field::{Basis, PlenOctree, Tables, from_rgb},
    sampling::Seen,
};

/// Returns luma and differences of the constant function of every leaf, corrected so that its mean visible color is the
/// same as before the other coefficients became rows of codebooks.
pub(super) fn corrected(
    field: &PlenOctree,
    seen: &[Seen],
    metric: &Metric,
    rows: &[[u16; 2]],
    tables: &Tables,
) -> Vec<[f32; 3]> {
    let others = metric.others();
    let constant = if field.basis() == Basis::Rgba { 1.0 } else { Basis::FACTORS[0] as f32 };
    let mut moments = Vec::new();
    let of_leaf = |(leaf, seen): (usize, &Seen)| {
        metric.of(&seen.views, &mut moments);
        let own = field.stored().of_functions(field.basis(), leaf).map(|color| color.map(f16::to_f32));
        let mut color = from_rgb(own[0]);
        if let Some(rows) = rows.get(leaf) {
            let shared = tables.rows(*rows, others);
            for (function, mean) in moments[..others].iter().enumerate() {
                let own = from_rgb(own[function + 1]);
                for part in 0..3 {
                    let error = own[part] - f32::from(shared[part][function]) * tables.table_step;
                    color[part] += error * mean / constant;
                }
            }
        }
        color
    };
    seen.iter().enumerate().map(of_leaf).collect()
}

/// The largest step that makes room for larger colors. It has room for luma of 16 and for differences of 4, in encoded
/// sRGB. What exceeds that is clipped.
const ROOM_UP_TO: f32 = 0.008;

/// Returns the least step with which no color is clipped, in encoded sRGB, or [`ROOM_UP_TO`] if that is less. `unit` is
/// the coefficient of encoded sRGB.
pub(super) fn least_step(colors: &[[f32; 3]], unit: f32) -> f32 {
    let of_part = |(part, (_, high)): (usize, (i16, i16))| {
        let most = colors.iter().map(|color| color[part].abs()).fold(0.0, f32::max);
        // A step may still become a little smaller.
        most / (0.98 * f32::from(high) * unit)
    };
    let steps = COLOR_RANGES.into_iter().enumerate().map(of_part);
    steps.fold(0.0, f32::max).min(ROOM_UP_TO)
}

/// Rounds colors to multiples of `step`.
///
/// Colors are stored as differences from the previous leaf, so a leaf's numbers are moved toward those of that leaf as
/// long as that saves bits. `bits` is how many bits a step of a channel of average visibility is worth.
pub(super) fn quantize(colors: &[[f32; 3]], seen: &[Seen], step: f32, bits: f32) -> Vec<[i16; 3]> {
    let mut before = [0i32; 3];
    let of_leaf = |(color, seen): (&[f32; 3], &Seen)| {
        let [red, green, blue] = seen.colors;
        let weights = [red + green + blue, red + blue, red + green + blue];
        for (part, weight) in weights.into_iter().enumerate() {
            let (low, high) = COLOR_RANGES[part];
            let wanted = (color[part] / step).clamp(low.into(), high.into());
            before[part] = nearest(wanted, before[part], weight * bits);
        }
        before.map(|steps| steps as i16)
    };
    colors.iter().zip(seen).map(of_leaf).collect()
}

/// Returns the number with the least cost: squared distance from `wanted` times `scale`, plus bits for the difference
/// from `before`. It is between `before` and `wanted`, rounded.
pub(super) fn nearest(wanted: f32, before: i32, scale: f32) -> i32 {
    let difference = wanted - before as f32;
    let rounded = difference.round();
    let cost = |change: f32| {
        let bits = 0.8 * (1.0 + change.abs()).log2();
        scale * (difference - change).powi(2) + bits
    };
    let toward = rounded.signum();
    let choices = [rounded, rounded - toward, rounded - 2.0 * toward, (rounded / 2.0).trunc(), 0.0];
    let valid = |change: &f32| change * toward >= 0.0 && change.abs() <= rounded.abs();
    let best = choices.into_iter().filter(valid).min_by(|a, b| cost(*a).total_cmp(&cost(*b))).unwrap_or(rounded);
    before + best as i32
}
