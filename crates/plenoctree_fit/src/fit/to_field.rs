//! Converts the fitted grid to a field.

use glam::IVec3;
use half::f16;
use plenoctree::{Activation, Basis, Frame, LoadSettings, PlenOctree, UpAxis};

use super::{
    error::FitError,
    grid::{Grid, Voxel, VoxelSet},
    stand::TurnedBox,
};
use crate::finest::{morton, tree_of};

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
    let mut leaves: Vec<(u64, u32, u32)> = (kept.voxels())
        .filter_map(|Voxel { corner, size }| {
            let voxel = grid.voxel(corner.as_ivec3())?;
            (density(grid, voxel) >= least).then_some((morton(corner), size.ilog2(), voxel))
        })
        .collect();
    if leaves.is_empty() {
        return Err(FitError::Empty);
    }
    leaves.sort_unstable();
    let places: Vec<(u64, u32)> = leaves.iter().map(|&(code, level, _)| (code, level)).collect();
    let nodes = tree_of(&places, depth);
    let densities = leaves.iter().map(|&(.., voxel)| density(grid, voxel) as f32).collect();
    let coefficients = (leaves.iter())
        .flat_map(|&(.., voxel)| {
            let values = &grid.values[voxel as usize * functions..][..functions];
            (0..3).flat_map(move |channel| values.iter().map(move |value| f16::from_f32(value[channel])))
        })
        .collect();
    let basis = Basis::from_functions(functions).unwrap_or(Basis::Sh1);
    Ok(PlenOctree::new(frame, basis, Activation::Sigmoid, UpAxis::Z, nodes, densities, coefficients)?)
}

fn density(grid: &Grid, voxel: u32) -> f64 {
    f64::from(grid.thickness[voxel as usize]) / grid.cell_size()
}

/// Returns the voxels of `kept` whose centers are in a box.
pub fn cropped(grid: &Grid, kept: &VoxelSet, to: &TurnedBox) -> VoxelSet {
    let mut inside = VoxelSet::new(grid.resolution());
    for voxel in kept.voxels() {
        if to.overlaps(grid.center(voxel), 0.0) {
            inside.insert(voxel);
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
    let number = |voxel: &Voxel| grid.voxel(voxel.corner.as_ivec3());
    let is_solid = |voxel: &Voxel| number(voxel).is_some_and(|number| grid.thickness[number as usize] >= thick);
    let solid: Vec<Voxel> = kept.voxels().filter(is_solid).collect();
    let places: Vec<Voxel> = grid.voxels().collect();
    let mut allowed = vec![false; grid.len()];
    solid.iter().filter_map(number).for_each(|number| allowed[number as usize] = true);
    for start in solid.iter().filter_map(number) {
        if part_of[start as usize] != NONE {
            continue;
        }
        let part = sizes.len() as u32;
        sizes.push(0);
        part_of[start as usize] = part;
        let mut stack = vec![start];
        while let Some(voxel) = stack.pop() {
            let place = places[voxel as usize];
            sizes[part as usize] += u64::from(place.size.pow(3));
            for next in around(grid, place) {
                if allowed[next as usize] && part_of[next as usize] == NONE {
                    part_of[next as usize] = part;
                    stack.push(next);
                }
            }
        }
    }
    let largest = (1..sizes.len()).max_by_key(|&part| sizes[part]).unwrap_or(0) as u32;
    let mut result = VoxelSet::new(grid.resolution());
    if largest == NONE {
        return result;
    }
    for voxel in kept.voxels() {
        if around(grid, voxel).any(|next| part_of[next as usize] == largest) {
            result.insert(voxel);
        }
    }
    result
}

/// Returns a voxel, and those that it touches, some of them several times.
fn around(grid: &Grid, voxel: Voxel) -> impl Iterator<Item = u32> {
    let (low, side) = (voxel.corner.as_ivec3() - 1, voxel.size as i32 + 2);
    let cells =
        (0..side.pow(3)).map(move |code| low + IVec3::new(code / (side * side), code / side % side, code % side));
    cells.filter_map(|cell| grid.voxel(cell))
}
