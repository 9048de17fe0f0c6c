//! Converts the fitted grid to a field.

use std::borrow::Cow;

use glam::{IVec3, Vec4};
use half::f16;
use plenoctree::{Activation, Basis, Frame, PlenOctree, UpAxis};

use super::{
    error::FitError,
    grid::{Grid, Voxel, VoxelSet},
    stand::TurnedBox,
};
use crate::finest::{least_density, morton, tree_of};

/// The difference of encoded colors and opacities up to which leaves are merged.
const TOLERANCE: f64 = 0.004;

/// Makes a field of the voxels in `kept`.
///
/// # Errors
///
/// Returns an error if no voxel is left.
pub fn to_field(grid: &Grid, kept: &VoxelSet) -> Result<PlenOctree, FitError> {
    field_of(grid, &leaves_of(grid, kept.voxels())?)
}

/// Makes a field of all voxels. Cubes of eight leaves that agree are merged, within the smallest tolerance that leaves
/// at most this many, if any does.
///
/// # Errors
///
/// Returns an error if no voxel is left.
pub fn to_merged_field(grid: &Grid, most: usize) -> Result<PlenOctree, FitError> {
    let leaves = leaves_of(grid, grid.voxels())?;
    let mut tolerance = TOLERANCE;
    loop {
        let merged = merged(&leaves, grid.cell_size(), tolerance);
        // Differences are at most 1.
        if merged.len() <= most || tolerance > 1.0 {
            return field_of(grid, &merged);
        }
        tolerance *= 2.0;
    }
}

/// A leaf of the field.
#[derive(Clone)]
struct Leaf<'a> {
    /// The code of its lowest cell.
    code: u64,
    /// Binary logarithm of its width in cells.
    level: u32,
    density: f64,
    /// Its coefficients, as in the grid.
    values: Cow<'a, [Vec4]>,
}

/// Returns the leaves of these voxels in order.
fn leaves_of(grid: &Grid, voxels: impl Iterator<Item = Voxel>) -> Result<Vec<Leaf<'_>>, FitError> {
    let frame = Frame::spanning(grid.cube().low, grid.cube().low + grid.cube().size);
    let least = f64::from(least_density(frame, grid.resolution().ilog2()));
    let functions = grid.functions();
    let leaf = |Voxel { corner, size }| {
        let voxel = grid.voxel(corner.as_ivec3())?;
        let values = Cow::Borrowed(&grid.values[voxel as usize * functions..][..functions]);
        let leaf = Leaf { code: morton(corner), level: size.ilog2(), density: density(grid, voxel), values };
        (leaf.density >= least).then_some(leaf)
    };
    let mut leaves: Vec<Leaf> = voxels.filter_map(leaf).collect();
    leaves.sort_unstable_by_key(|leaf| leaf.code);
    if leaves.is_empty() { Err(FitError::Empty) } else { Ok(leaves) }
}

/// Makes the field of these leaves.
fn field_of(grid: &Grid, leaves: &[Leaf]) -> Result<PlenOctree, FitError> {
    let (cube, depth) = (grid.cube(), grid.resolution().ilog2());
    let frame = Frame::spanning(cube.low, cube.low + cube.size);
    let places: Vec<(u64, u32)> = leaves.iter().map(|leaf| (leaf.code, leaf.level)).collect();
    let nodes = tree_of(&places, depth);
    let densities = leaves.iter().map(|leaf| leaf.density as f32).collect();
    let channels = |leaf: &'_ Leaf| -> Vec<f16> {
        let channel = |channel: usize| leaf.values.iter().map(move |value| f16::from_f32(value[channel]));
        (0..3).flat_map(channel).collect()
    };
    let coefficients = leaves.iter().flat_map(channels).collect();
    let basis = Basis::from_functions(grid.functions()).unwrap_or(Basis::Sh1);
    Ok(PlenOctree::new(frame, basis, Activation::Sigmoid, UpAxis::Z, nodes, densities, coefficients)?)
}

/// Merges cubes of eight leaves, and those of what they become, whose pictures differ by at most `tolerance`. `width`
/// is that of a cell.
fn merged<'a>(leaves: &[Leaf<'a>], width: f64, tolerance: f64) -> Vec<Leaf<'a>> {
    let mut all: Vec<Leaf> = Vec::with_capacity(leaves.len());
    for leaf in leaves {
        all.push(leaf.clone());
        while let Some(whole) = all.last_chunk().and_then(|parts| whole(parts, width, tolerance)) {
            all.truncate(all.len() - 8);
            all.push(whole);
        }
    }
    all
}

/// Returns the leaf that eight leaves become, if they are the parts of a cube and agree.
fn whole<'a>(parts: &[Leaf<'a>; 8], width: f64, tolerance: f64) -> Option<Leaf<'a>> {
    let Leaf { code, level, .. } = parts[0];
    let is_cube = code.is_multiple_of(8 << (3 * level)) && parts[7].code == code + (7 << (3 * level));
    if !is_cube || parts.iter().any(|part| part.level != level) {
        return None;
    }
    let opacity = |part: &Leaf| 1.0 - (-part.density * width * f64::from(1u32 << level)).exp();
    let opacities = parts.each_ref().map(opacity);
    let (least, most) = opacities.iter().fold((f64::MAX, 0.0f64), |(a, b), x| (a.min(*x), b.max(*x)));
    let mut values = vec![Vec4::ZERO; parts[0].values.len()];
    for part in parts {
        values.iter_mut().zip(part.values.iter()).for_each(|(mean, value)| *mean += 0.125 * *value);
    }
    // The largest difference of the constant coefficients, and others, changes a color by a quarter of its sum.
    let change = |part: &Leaf| -> f32 {
        let differences = part.values.iter().zip(&values).map(|(a, b)| (*a - *b).truncate().abs().max_element());
        differences.sum()
    };
    let change = parts.iter().map(change).fold(0.0, f32::max);
    let color = 0.25 * Basis::FACTORS[0] * f64::from(change);
    let density = 0.125 * parts.iter().map(|part| part.density).sum::<f64>();
    (most - least <= tolerance && most * color <= tolerance).then(|| Leaf {
        code,
        level: level + 1,
        density,
        values: values.into(),
    })
}

fn density(grid: &Grid, voxel: u32) -> f64 {
    f64::from(grid.thickness[voxel as usize]) / grid.cell_size()
}

/// Returns the voxels of `kept` whose centers are in a box.
pub fn cropped(grid: &Grid, kept: &VoxelSet, to: &TurnedBox) -> VoxelSet {
    VoxelSet::of(grid.resolution(), kept.voxels().filter(|voxel| to.overlaps(grid.center(*voxel), 0.0)))
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
    let is_near = |voxel: &Voxel| around(grid, *voxel).any(|next| part_of[next as usize] == largest);
    VoxelSet::of(grid.resolution(), kept.voxels().filter(|voxel| largest != NONE && is_near(voxel)))
}

/// Returns a voxel, and those that it touches, some of them several times.
fn around(grid: &Grid, voxel: Voxel) -> impl Iterator<Item = u32> {
    let (low, side) = (voxel.corner.as_ivec3() - 1, voxel.size as i32 + 2);
    let cells =
        (0..side.pow(3)).map(move |code| low + IVec3::new(code / (side * side), code / side % side, code % side));
    cells.filter_map(|cell| grid.voxel(cell))
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, UVec3};

    use super::*;
    use crate::fit::grid::Cube;

    /// A cube of 4 x 4 x 4 voxels in a larger grid, and one voxel next to it. Those of the cube are as thick and as
    /// bright as the functions say.
    fn grid(thickness: impl Fn(UVec3) -> f32, light: impl Fn(UVec3) -> f32) -> Grid {
        let mut set = VoxelSet::new(64);
        (Voxel { corner: UVec3::splat(8), size: 4 })
            .children()
            .flat_map(Voxel::children)
            .for_each(|part| set.insert(part));
        set.insert(Voxel::cell(UVec3::new(20, 0, 0)));
        let mut grid = Grid::new(Cube { low: DVec3::ZERO, size: 1.0 }, 1, &set);
        let values: Vec<Vec4> =
            grid.voxels().map(|Voxel { corner, .. }| Vec4::splat(light(corner)).with_w(thickness(corner))).collect();
        grid.values = values;
        grid.copy_thickness();
        grid
    }

    fn sizes(field: &PlenOctree) -> Vec<u32> {
        let mut sizes: Vec<u32> = field.leaf_cells().map(|cell| cell.size).collect();
        sizes.sort_unstable();
        sizes
    }

    /// Leaves that agree are merged, again and again, and keep their density.
    #[test]
    fn equal_leaves_are_merged() {
        let field = to_merged_field(&grid(|_| 0.3, |_| 0.5), usize::MAX).unwrap();
        assert_eq!(sizes(&field), [1, 4]);
        assert!(field.densities().iter().all(|density| (density / (0.3 * 64.0) - 1.0).abs() < 1e-5));
    }

    /// Leaves that differ in what is seen of them are not, unless there would be too many.
    #[test]
    fn different_leaves_are_merged_only_if_there_are_too_many() {
        let is_light = |at: UVec3| at.element_sum().is_multiple_of(2);
        let striped = grid(|_| 0.3, |at| if is_light(at) { 1.0 } else { -1.0 });
        let uneven = grid(|at| if is_light(at) { 0.3 } else { 0.2 }, |_| 0.0);
        for grid in [striped, uneven] {
            assert_eq!(to_merged_field(&grid, usize::MAX).unwrap().leaves(), 65);
            assert_eq!(sizes(&to_merged_field(&grid, 2).unwrap()), [1, 4]);
        }
    }
}
