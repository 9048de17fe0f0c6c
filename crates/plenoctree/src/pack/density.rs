//! Rounds densities to a few levels.

use half::f16;

use crate::{field::PlenOctree, sampling::Seen};

/// The largest number of levels by which a density is moved to save bits.
const REACH: u32 = 4;

/// Returns at most `count` densities, in ascending order, and which of them every leaf gets.
///
/// Leaves whose density matters little get a frequent one, which saves bits: `bits` is how many bits a squared error of
/// opacity is worth in a leaf that is fully visible.
///
/// Levels are spread evenly over the mean opacity of paths through a finest cell. Paths through a cell have all lengths
/// up to its diagonal. If short ones are more likely than long ones, exponentially so, their mean opacity is `d / (1 +
/// d)` for the optical depth `d` of the cell's width.
pub(super) fn quantize(field: &PlenOctree, seen: &[Seen], count: u32, bits: f32) -> (Vec<f16>, Vec<u8>) {
    let width = (field.frame().scale * f64::from(1u32 << field.depth())).element_product().cbrt().recip();
    let opacity = |density: f32| {
        let depth = f64::from(density) * width;
        if depth.is_finite() { depth / (1.0 + depth) } else { 1.0 }
    };
    let lowest = field.densities().iter().copied().fold(f32::INFINITY, f32::min);
    let density = |opacity: f64| {
        let density = f16::from_f64(opacity / (1.0 - opacity).max(f64::MIN_POSITIVE) / width);
        let density = density.clamp(f16::MIN_POSITIVE_SUBNORMAL, f16::MAX);
        // Not below what readers keep.
        if density.to_f32() < lowest && density < f16::MAX { f16::from_bits(density.to_bits() + 1) } else { density }
    };
    let opacities: Vec<f64> = field.densities().iter().map(|density| opacity(*density)).collect();
    let low = opacities.iter().copied().fold(f64::INFINITY, f64::min);
    let high = opacities.iter().copied().fold(low, f64::max);
    let last = f64::from(count - 1);
    let place = |opacity: f64| (opacity - low) / (high - low).max(f64::MIN_POSITIVE) * last;
    let mut levels: Vec<u32> = opacities.iter().map(|opacity| place(*opacity).round() as u32).collect();
    let bits = f64::from(bits) * ((high - low) / last).powi(2);
    for _ in 0..2 {
        let mut counts = vec![0.5; count as usize];
        levels.iter().for_each(|level| counts[*level as usize] += 1.0);
        let costs: Vec<f64> = counts.iter().map(|count| (levels.len() as f64 / count).log2()).collect();
        for ((level, opacity), seen) in levels.iter_mut().zip(&opacities).zip(seen) {
            let place = place(*opacity);
            let nearest = place.round() as u32;
            let cost = |level: &u32| {
                bits * f64::from(seen.depth) * (f64::from(*level) - place).powi(2) + costs[*level as usize]
            };
            let near = nearest.saturating_sub(REACH)..=(nearest + REACH).min(count - 1);
            *level = near.min_by(|a, b| cost(a).total_cmp(&cost(b))).unwrap_or(nearest);
        }
    }
    // The mean of what is seen in each level.
    let mut sums = vec![(0.0, 0.0); count as usize];
    for ((opacity, seen), level) in opacities.iter().zip(seen).zip(&levels) {
        let weight = f64::from(seen.depth).max(1e-6);
        let (sum, total) = &mut sums[*level as usize];
        *sum += weight * opacity;
        *total += weight;
    }
    let mut densities = Vec::new();
    let renumbered: Vec<u8> = sums
        .iter()
        .map(|(sum, total)| {
            if *total > 0.0 {
                densities.push(density(sum / total));
            }
            densities.len().saturating_sub(1) as u8
        })
        .collect();
    let levels = levels.iter().map(|level| renumbered[*level as usize]).collect();
    (densities, levels)
}
