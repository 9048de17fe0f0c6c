//! Rounds densities to a few levels.

use half::f16;

use super::split::{Points, split};
use crate::{
    field::PlenOctree,
    sampling::{Canceled, Progress, Seen},
};

/// The largest number of levels by which a density is moved to save bits.
const REACH: usize = 4;
/// Width of a leaf, in finest cells, from which it is large: a small error of its density shows.
const LARGE: f64 = 4.0;
/// The share of the levels that are for large leaves, if there are any.
const LARGE_SHARE: usize = 3;

/// A leaf's density.
struct Leaf {
    /// Mean opacity of paths through a finest cell with the leaf's density.
    opacity: f64,
    /// In finest cells.
    size: f64,
    /// A pixel's squared error per squared error of the leaf's own opacity.
    depth: f64,
}

impl Leaf {
    /// Returns the mean opacity of paths through the leaf, if paths through a finest cell have a mean `opacity`.
    fn own(&self, opacity: f64) -> f64 {
        // Exact for a finest cell.
        if self.size == 1.0 { opacity } else { self.size * opacity / (1.0 + (self.size - 1.0) * opacity) }
    }

    /// Returns a pixel's squared error per small squared error of [`Self::opacity`].
    fn weight(&self) -> f64 {
        let slope = self.size / (1.0 + (self.size - 1.0) * self.opacity).powi(2);
        self.depth.max(1e-6) * slope * slope
    }
}

/// Returns at most `count` densities, in ascending order, and which of them every leaf gets.
///
/// Leaves whose density matters little get a frequent one, which saves bits: `bits` is how many bits a squared error of
/// opacity is worth in a leaf that is fully visible.
///
/// Levels are spread evenly over the mean opacity of paths through a finest cell. Paths through a cell have all lengths
/// up to its diagonal. If short ones are more likely than long ones, exponentially so, their mean opacity is `d / (1 +
/// d)` for the optical depth `d` of the cell's width. The opacity of large leaves changes much more with density, so if
/// there are any, a third of the levels are where they are needed most.
pub(super) fn quantize(
    field: &PlenOctree,
    seen: &[Seen],
    count: u32,
    bits: f32,
    progress: &Progress,
) -> Result<(Vec<f16>, Vec<u8>), Canceled> {
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
    let mut sizes = vec![1.0; seen.len()];
    field.leaf_cells().for_each(|cell| sizes[cell.leaf as usize] = f64::from(cell.size));
    let leaf = |((density, size), seen): ((&f32, f64), &Seen)| Leaf {
        opacity: opacity(*density),
        size,
        depth: f64::from(seen.depth),
    };
    let leaves: Vec<Leaf> = field.densities().iter().zip(sizes).zip(seen).map(leaf).collect();
    let levels = levels(&leaves, count as usize, progress)?;
    let bits = f64::from(bits);
    let nearest = |leaf: &Leaf| {
        let above = levels.partition_point(|level| *level < leaf.opacity).min(levels.len().saturating_sub(1));
        let distance = |level: usize| (levels[level] - leaf.opacity).abs();
        if above > 0 && distance(above - 1) < distance(above) { above - 1 } else { above }
    };
    let nearest: Vec<usize> = leaves.iter().map(nearest).collect();
    let mut chosen = nearest.clone();
    for _ in 0..2 {
        let mut counts = vec![0.5; levels.len()];
        chosen.iter().for_each(|level| counts[*level] += 1.0);
        let costs: Vec<f64> = counts.iter().map(|count| (leaves.len() as f64 / count).log2()).collect();
        for ((chosen, nearest), leaf) in chosen.iter_mut().zip(&nearest).zip(&leaves) {
            let own = leaf.own(leaf.opacity);
            let cost = |level: &usize| bits * leaf.depth * (leaf.own(levels[*level]) - own).powi(2) + costs[*level];
            let near = nearest.saturating_sub(REACH)..=(nearest + REACH).min(levels.len() - 1);
            *chosen = near.min_by(|a, b| cost(a).total_cmp(&cost(b))).unwrap_or(*nearest);
        }
    }
    // The mean of what is seen in each level.
    let mut sums = vec![(0.0, 0.0); levels.len()];
    for (leaf, level) in leaves.iter().zip(&chosen) {
        let weight = leaf.weight();
        let (sum, total) = &mut sums[*level];
        *sum += weight * leaf.opacity;
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
    Ok((densities, chosen.into_iter().map(|level| renumbered[level]).collect()))
}

/// Returns at most `count` opacities of finest cells, in ascending order.
fn levels(leaves: &[Leaf], count: usize, progress: &Progress) -> Result<Vec<f64>, Canceled> {
    let large: Vec<&Leaf> = leaves.iter().filter(|leaf| leaf.size > LARGE).collect();
    let points = Points {
        width: 1,
        values: large.iter().map(|leaf| leaf.opacity as f32).collect(),
        weights: large.iter().map(|leaf| leaf.weight() as f32).collect(),
    };
    let most = if large.is_empty() { 0 } else { count / LARGE_SHARE };
    let mut levels = Vec::with_capacity(count);
    if most > 0 {
        levels.extend(split(&points, most, progress)?.0.into_iter().map(f64::from));
    }
    let low = leaves.iter().map(|leaf| leaf.opacity).fold(f64::INFINITY, f64::min);
    let high = leaves.iter().map(|leaf| leaf.opacity).fold(low, f64::max);
    let even = count - levels.len();
    levels.extend((0..even).map(|level| low + (high - low) * level as f64 / (even - 1).max(1) as f64));
    levels.sort_by(f64::total_cmp);
    levels.dedup();
    Ok(levels)
}
