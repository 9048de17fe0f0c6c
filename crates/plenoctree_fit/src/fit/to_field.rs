//! Converts the fitted grid to a field.

use glam::IVec3;
use half::f16;
use plenoctree::{Activation, Basis, Frame, LoadSettings, PlenOctree, UpAxis};

use super::{
    error::FitError,
    grid::{Grid, VoxelSet},
    stand::TurnedBox,
};
use crate::finest::{morton, tree_of_finest};

/// Makes a field of the voxels in `kept`.
///
/// # Errors
///
/// Returns an error if no voxel is left.
pub fn to_field(grid: &Grid, kept: &VoxelSet) -> Result<PlenOctree, FitError> {
    let functions = grid.functions();
    let (cube, depth) = (grid.cube(), grid.resolution().ilog2());
    let frame = Frame::spanning(cube.low, cube.low + cube.size);
    // Readers of files would drop the others.
    let least = f64::from(LoadSettings::default().density_threshold_in(frame, depth));
    let mut leaves: Vec<(u64, u32)> = (kept.positions())
        .filter_map(|position| {
            let voxel = grid.voxel(position.as_ivec3())?;
            (density(grid, voxel) >= least).then_some((morton(position), voxel))
        })
        .collect();
    if leaves.is_empty() {
        return Err(FitError::Empty);
    }
    leaves.sort_unstable();
    let codes: Vec<u64> = leaves.iter().map(|(code, _)| *code).collect();
    let nodes = tree_of_finest(&codes, depth);
    let densities = leaves.iter().map(|&(_, voxel)| density(grid, voxel) as f32).collect();
    let coefficients = (leaves.iter())
        .flat_map(|&(_, voxel)| {
            let values = &grid.values[voxel as usize * functions..][..functions];
            (0..3).flat_map(move |channel| values.iter().map(move |value| f16::from_f32(value[channel])))
        })
        .collect();
    let basis = Basis::from_functions(functions).unwrap_or(Basis::Sh1);
    Ok(PlenOctree::new(frame, basis, Activation::Sigmoid, UpAxis::Z, nodes, densities, coefficients)?)
}

fn density(grid: &Grid, voxel: u32) -> f64 {
    f64::from(grid.thickness[voxel as usize]) / grid.voxel_size()
}

/// Returns the voxels of `kept` whose centers are in a box.
pub fn cropped(grid: &Grid, kept: &VoxelSet, to: &TurnedBox) -> VoxelSet {
    let mut inside = VoxelSet::new(grid.resolution());
    for position in kept.positions() {
        if to.overlaps(grid.center(position), 0.0) {
            inside.insert(position);
        }
    }
    inside
}

/// Returns the largest part of `kept` that is connected through voxels at least `thick`, and the thinner voxels around
/// it.
pub fn largest_part(grid: &Grid, kept: &VoxelSet, thick: f32) -> VoxelSet {
    const NONE: u32 = 0;
    let mut part_of = vec![NONE; grid.len()];
    let mut sizes = vec![0u64];
    let around: Vec<IVec3> = (0..27).map(|code| IVec3::new(code / 9 - 1, code / 3 % 3 - 1, code % 3 - 1)).collect();
    let solid: Vec<IVec3> = (kept.positions().map(|position| position.as_ivec3()))
        .filter(|position| grid.voxel(*position).is_some_and(|voxel| grid.thickness[voxel as usize] >= thick))
        .collect();
    let mut allowed = vec![false; grid.len()];
    for voxel in solid.iter().filter_map(|position| grid.voxel(*position)) {
        allowed[voxel as usize] = true;
    }
    for start in &solid {
        let Some(voxel) = grid.voxel(*start).filter(|voxel| part_of[*voxel as usize] == NONE) else { continue };
        let part = sizes.len() as u32;
        sizes.push(1);
        part_of[voxel as usize] = part;
        let mut stack = vec![*start];
        while let Some(position) = stack.pop() {
            for offset in &around {
                if let Some(next) = grid.voxel(position + offset)
                    && allowed[next as usize]
                    && part_of[next as usize] == NONE
                {
                    part_of[next as usize] = part;
                    sizes[part as usize] += 1;
                    stack.push(position + offset);
                }
            }
        }
    }
    let largest = (1..sizes.len()).max_by_key(|&part| sizes[part]).unwrap_or(0) as u32;
    let mut result = VoxelSet::new(grid.resolution());
    if largest == NONE {
        return result;
    }
    for position in kept.positions() {
        let near = around.iter().filter_map(|offset| grid.voxel(position.as_ivec3() + offset));
        if near.into_iter().any(|voxel| part_of[voxel as usize] == largest) {
            result.insert(position);
        }
    }
    result
}
