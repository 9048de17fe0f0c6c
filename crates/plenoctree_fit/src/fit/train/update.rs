//! Applies the gradients of a batch: RMSProp, with one step size per voxel and channel.

use glam::Vec4;
use rayon::prelude::*;

use super::batch::{BLOCK, Part};
use crate::fit::grid::{Grid, NO_VOXEL};

/// Largest thickness of a voxel: hardly any light gets through.
const MAX_THICKNESS: f32 = 40.0;
/// Difference of thickness at which the total variation turns from squares to absolute values.
const SOFT: f32 = 0.1;
/// Difference of constant coefficients at which their total variation does so: 0.02 in encoded sRGB.
const SOFT_COLOR: f32 = 0.3;

/// Learning rates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rates {
    /// For the constant coefficient.
    pub constant: f32,
    /// For all other coefficients.
    pub directional: f32,
    /// For the thickness.
    pub thickness: f32,
}

/// Penalties: terms of the loss for each voxel that a batch sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Penalties {
    /// Total variation of the thickness.
    pub variation: f32,
    /// `atan` of the thickness itself, which hardly affects voxels that are opaque anyway.
    pub presence: f32,
    /// Squares of all coefficients except the constant one.
    pub direction: f32,
    /// Total variation of the constant coefficients.
    pub color: f32,
}

/// Constants of the optimizer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optimizer {
    pub rates: Rates,
    /// The thickness below which the rate of the thickness falls in proportion, so that steps do not empty thin voxels.
    pub thin: f32,
    pub penalties: Penalties,
}

/// Decay of the mean square of the gradient.
const DECAY: f32 = 0.99;
/// Added to the root of the mean square, so that much smaller gradients are followed more slowly.
const FLOOR: f32 = 1e-8;

/// What voxels compare themselves with: the values of all voxels before the batch.
struct Neighbors<'a> {
    thickness: &'a [f32],
    /// The constant coefficients; empty if they are not compared.
    colors: Vec<Vec4>,
}

/// Updates all voxels that the batch saw. `thickness` is memory for the new copy of the grid's thickness.
pub fn update(grid: &mut Grid, parts: &[Part], optimizer: &Optimizer, thickness: &mut Vec<f32>) {
    match grid.functions() {
        1 => update_blocks::<1>(grid, parts, optimizer, thickness),
        4 => update_blocks::<4>(grid, parts, optimizer, thickness),
        16 => update_blocks::<16>(grid, parts, optimizer, thickness),
        _ => update_blocks::<9>(grid, parts, optimizer, thickness),
    }
}

fn update_blocks<const B: usize>(grid: &mut Grid, parts: &[Part], optimizer: &Optimizer, thickness: &mut Vec<f32>) {
    thickness.resize(grid.len(), 0.0);
    let compares_colors = optimizer.penalties.color > 0.0;
    let colors = || grid.values.par_chunks(B).map(|values| values[0]).collect();
    let old = Neighbors { thickness: &grid.thickness, colors: if compares_colors { colors() } else { Vec::new() } };
    let values = grid.values.par_chunks_mut(BLOCK * B);
    let squares = grid.squares.par_chunks_mut(BLOCK);
    let updates = grid.updates.par_chunks_mut(BLOCK);
    let new = thickness.par_chunks_mut(BLOCK);
    let all = values.zip(squares).zip(updates).zip(new).enumerate();
    all.with_min_len(4).for_each_init(
        || (vec![[Vec4::ZERO; B]; BLOCK], vec![false; BLOCK]),
        |(sums, seen), (block, (((values, squares), updates), new))| {
            let first = block * BLOCK;
            new.copy_from_slice(&old.thickness[first..][..new.len()]);
            for part in parts {
                let [start, end] = [part.starts[block], part.starts[block + 1]];
                for gradient in &part.gradients[start as usize..end as usize] {
                    let voxel = gradient.voxel as usize - first;
                    let basis = &part.bases[gradient.tile as usize];
                    let all = Vec4::from_array(gradient.gradient);
                    let mut color = all;
                    color.w = 0.0;
                    for (sum, y) in sums[voxel].iter_mut().zip(basis) {
                        *sum += *y * color;
                    }
                    sums[voxel][0].w += all.w;
                    seen[voxel] = true;
                }
            }
            for voxel in 0..new.len() {
                if !std::mem::take(&mut seen[voxel]) {
                    continue;
                }
                let sums = std::mem::replace(&mut sums[voxel], [Vec4::ZERO; B]);
                let values = &mut values[voxel * B..][..B];
                let neighbors = &grid.neighbors[first + voxel];
                step::<B>(values, sums, &mut squares[voxel], &mut updates[voxel], neighbors, &old, optimizer);
                new[voxel] = values[0].w;
            }
        },
    );
    std::mem::swap(&mut grid.thickness, thickness);
}

/// Updates one voxel.
#[inline]
fn step<const B: usize>(
    values: &mut [Vec4],
    mut sums: [Vec4; B],
    square: &mut Vec4,
    updates: &mut u16,
    neighbors: &[u32; 6],
    old: &Neighbors,
    optimizer: &Optimizer,
) {
    let Optimizer { rates, thin, penalties } = *optimizer;
    let own = values[0].w;
    let mut slope = 0.0;
    for &neighbor in neighbors {
        let other = if neighbor == NO_VOXEL { 0.0 } else { old.thickness[neighbor as usize] };
        let difference = own - other;
        slope += penalties.variation * difference / (difference * difference + SOFT * SOFT).sqrt();
    }
    if own > 0.0 {
        slope += penalties.presence / (1.0 + own * own);
    }
    sums[0].w += slope;
    if penalties.direction > 0.0 {
        for (sum, value) in sums[1..].iter_mut().zip(&values[1..]) {
            *sum += penalties.direction * *value;
        }
    }
    if penalties.color > 0.0 {
        for &neighbor in neighbors.iter().filter(|neighbor| **neighbor != NO_VOXEL) {
            let mut difference = values[0] - old.colors[neighbor as usize];
            difference.w = 0.0;
            sums[0] += penalties.color / (difference.length_squared() + SOFT_COLOR * SOFT_COLOR).sqrt() * difference;
        }
    }

    let mut power: Vec4 = sums.iter().map(|sum| *sum * *sum).sum::<Vec4>() / B as f32;
    power.w = sums[0].w * sums[0].w;
    // A plain mean at first.
    let decay = DECAY.min(f32::from(*updates) / (f32::from(*updates) + 1.0));
    *updates = updates.saturating_add(1);
    *square = decay * *square + (1.0 - decay) * power;
    let scale = (Vec4::from_array(square.to_array().map(f32::sqrt)) + Vec4::splat(FLOOR)).recip();

    let thickness = if own < thin { rates.thickness * own / thin } else { rates.thickness };
    let constant = Vec4::new(rates.constant, rates.constant, rates.constant, thickness);
    values[0] -= constant * scale * sums[0];
    values[0].w = values[0].w.clamp(0.0, MAX_THICKNESS);
    for (value, sum) in values[1..].iter_mut().zip(&sums[1..]) {
        *value -= rates.directional * scale * *sum;
    }
}
