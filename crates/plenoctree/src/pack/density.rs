//! Rounds densities to a few levels.

use half::f16;

use crate::{field::PlenOctree, sampling::Seen};

/// Returns at most `count` densities, in ascending order, and which of them every leaf gets.
///
/// Levels are spread evenly over the mean opacity of paths through a finest cell. Paths through a cell have all lengths
/// up to its diagonal. If short ones are more likely than long ones, exponentially so, their mean opacity is `d / (1 + d)`
/// for the optical depth `d` of the cell's width.
pub(super) fn quantize(field: &PlenOctree, seen: &[Seen], count: u32) -> (Vec<f16>, Vec<u8>) {
    let width = (field.frame().scale * f64::from(1u32 << field.depth())).element_product().cbrt().recip();
    let opacity = |density: f32| {
        let depth = f64::from(density) * width;
        if depth.is_finite() { depth / (1.0 + depth) } else { 1.0 }
    };
    let density = |opacity: f64| {
        let density = f16::from_f64(opacity / (1.0 - opacity).max(f64::MIN_POSITIVE) / width);
        density.clamp(f16::MIN_POSITIVE_SUBNORMAL, f16::MAX)
    };
    let opacities: Vec<f64> = field.densities().iter().map(|density| opacity(*density)).collect();
    let low = opacities.iter().copied().fold(f64::INFINITY, f64::min);
    let high = opacities.iter().copied().fold(low, f64::max);
    let last = f64::from(count - 1);
    let level = |opacity: f64| ((opacity - low) / (high - low).max(f64::MIN_POSITIVE) * last).round() as usize;
    // The mean of what is seen in each level.
    let mut sums = vec![(0.0, 0.0); count as usize];
    for (opacity, seen) in opacities.iter().zip(seen) {
        let weight = f64::from(seen.depth).max(1e-6);
        let (sum, total) = &mut sums[level(*opacity)];
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
    let levels = opacities.iter().map(|opacity| renumbered[level(*opacity)]).collect();
    (densities, levels)
}
