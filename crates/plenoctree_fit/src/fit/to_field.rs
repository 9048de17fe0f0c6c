//! Converts the fitted grid to a field.

use std::borrow::Cow;

use glam::{IVec3, Vec3, Vec4};
use half::f16;
use plenoctree::{Activation, Basis, Frame, PlenOctree, UpAxis};
use rayon::prelude::*;

use super::{
    error::FitError,
    grid::{Grid, NO_VOXEL, Voxel, VoxelSet},
    turned_box::TurnedBox,
};
use crate::{
    cells::{BLOCK, Cells, Tree, price},
    exponential::sigmoid,
    finest::{least_density, morton, tree_of},
};

/// The smallest squared error, as a share of the pixels of pictures, for which a leaf is kept.
const LEAST_PRICE: f32 = 1e-11;
/// Levels of merged leaves above the finest cells.
const LEVELS: [u8; 2] = [0, BLOCK as u8];
/// Margin from 0 and 1 within which colors of merged leaves are kept, where the inverse of the sigmoid is steep.
const MARGIN: f32 = 1e-3;

/// Makes a field of the voxels in `kept`.
///
/// # Errors
///
/// Returns an error if no voxel is left.
pub fn to_field(grid: &Grid, kept: &VoxelSet) -> Result<PlenOctree, FitError> {
    field_of(grid, &leaves_of(grid, kept.voxels())?)
}

/// Makes a field of all voxels, of which those are merged whose merging changes pictures least. It has at most `most`
/// leaves, or fewer if more would hardly show, but every block of cells keeps one. `seen` says how visible each voxel
/// is: see [`seen`](super::train::visibility::seen).
///
/// # Errors
///
/// Returns an error if no voxel is left.
pub fn to_merged_field(grid: &Grid, seen: &[f32], most: usize) -> Result<PlenOctree, FitError> {
    let leaves = leaves_of(grid, grid.voxels())?;
    let mut cells = Cells::default();
    let mut radiance = Vec::new();
    for leaf in &leaves {
        radiance.clear();
        append_radiance(&leaf.values, &mut radiance);
        let thickness = leaf.density * width(grid, leaf.level);
        cells.push(leaf.code, leaf.level as u8, thickness as f32, seen[leaf.voxel as usize], &radiance);
    }
    let trees: Vec<Tree> =
        cells.blocks(|_| true).par_iter().map(|cells| Tree::new(cells, LEAST_PRICE, LEVELS)).collect();
    let price = price(&trees, most).max(LEAST_PRICE);
    let chosen = Cells::joined(trees.par_iter().map(|tree| tree.cells(&tree.cut(price))).collect());
    let mut same = leaves.iter().peekable();
    let mut merged = Vec::with_capacity(chosen.len());
    for (cell, (&code, &level)) in chosen.codes.iter().zip(&chosen.levels).enumerate() {
        let leaf = std::iter::from_fn(|| same.next_if(|leaf| leaf.code <= code)).last();
        merged.push(match leaf {
            Some(leaf) if leaf.code == code && leaf.level == u32::from(level) => leaf.clone(),
            _ => Leaf {
                code,
                level: level.into(),
                voxel: NO_VOXEL,
                density: f64::from(chosen.thickness[cell]) / width(grid, level.into()),
                values: values_of(chosen.color(cell)),
            },
        });
    }
    field_of(grid, &merged)
}

/// A leaf of the field.
#[derive(Clone)]
struct Leaf<'a> {
    /// The code of its lowest cell.
    code: u64,
    /// Binary logarithm of its width in cells.
    level: u32,
    /// The voxel that it is, or [`NO_VOXEL`] if it is merged.
    voxel: u32,
    density: f64,
    /// Its coefficients, as in the grid.
    values: Cow<'a, [Vec4]>,
}

/// Returns the width of a leaf of this level, in world units.
fn width(grid: &Grid, level: u32) -> f64 {
    grid.cell_size() * f64::from(1u32 << level)
}

/// Returns the leaves of these voxels in order.
fn leaves_of(grid: &Grid, voxels: impl Iterator<Item = Voxel>) -> Result<Vec<Leaf<'_>>, FitError> {
    let frame = Frame::spanning(grid.cube().low, grid.cube().low + grid.cube().size);
    let least = f64::from(least_density(frame));
    let functions = grid.functions();
    let leaf = |Voxel { corner, size }| {
        let voxel = grid.voxel(corner.as_ivec3())?;
        let values = Cow::Borrowed(&grid.values[voxel as usize * functions..][..functions]);
        let leaf = Leaf { code: morton(corner), level: size.ilog2(), voxel, density: density(grid, voxel), values };
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

/// Appends the coefficients of radiance, red, green and blue for each function, to which a voxel's values lead if
/// directions change its color little.
fn append_radiance(values: &[Vec4], radiance: &mut Vec<f32>) {
    let constant = Basis::FACTORS[0] as f32;
    let color = sigmoid(constant * values[0]);
    radiance.extend((color / constant).truncate().to_array());
    let slope = color * (Vec4::ONE - color);
    values[1..].iter().for_each(|value| radiance.extend((slope * *value).truncate().to_array()));
}

/// The inverse of [`append_radiance`], for colors that are not nearly black or fully bright. There is no thickness.
fn values_of<'a>(radiance: &[f32]) -> Cow<'a, [Vec4]> {
    let constant = Basis::FACTORS[0] as f32;
    let color = (constant * Vec3::from_slice(radiance)).clamp(Vec3::splat(MARGIN), Vec3::splat(1.0 - MARGIN));
    let (rest, slope) = (Vec3::ONE - color, color * (Vec3::ONE - color));
    let first = Vec3::from_array((color / rest).to_array().map(f32::ln)) / constant;
    let others = radiance[3..].chunks_exact(3).map(|value| Vec3::from_slice(value) / slope);
    std::iter::once(first).chain(others).map(|value| value.extend(0.0)).collect()
}

fn density(grid: &Grid, voxel: u32) -> f64 {
    f64::from(grid.thickness[voxel as usize]) / grid.cell_size()
}

/// Returns the voxels of `kept` whose centers are in a box.
pub fn cropped(grid: &Grid, kept: &VoxelSet, to: &TurnedBox) -> VoxelSet {
    VoxelSet::of(grid.resolution(), kept.voxels().filter(|voxel| to.overlaps(grid.center(*voxel), 0.0)))
}

/// Returns the largest part of `kept` that is connected through voxels at least `thick`, and the thinner voxels around
/// it. If no voxel is that thick, nothing is connected, and all are returned.
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
    VoxelSet::of(grid.resolution(), kept.voxels().filter(|voxel| largest == NONE || is_near(voxel)))
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
    use proptest::prelude::*;

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

    /// Makes the field of a grid of which all is visible.
    fn merged(grid: &Grid, most: usize) -> PlenOctree {
        to_merged_field(grid, &vec![1e-6; grid.len()], most).unwrap()
    }

    /// Leaves that agree are merged, again and again, and keep their density and color.
    #[test]
    fn equal_leaves_are_merged() {
        let field = merged(&grid(|_| 0.3, |_| 0.5), usize::MAX);
        assert_eq!(sizes(&field), [1, 4]);
        assert!(field.densities().iter().all(|density| (density / (0.3 * 64.0) - 1.0).abs() < 1e-5));
        assert!(field.coefficients().iter().all(|value| (value.to_f32() - 0.5).abs() < 1e-3));
    }

    /// The largest part is kept, or all of a haze without solid parts.
    #[test]
    fn the_largest_part_of_haze_is_all_of_it() {
        for (thickness, kept) in [(0.3, 64), (0.1, 65)] {
            let grid = grid(|_| thickness, |_| 0.0);
            let all = VoxelSet::of(grid.resolution(), grid.voxels());
            assert_eq!(largest_part(&grid, &all, 0.2).voxels().count(), kept, "{thickness}");
        }
    }

    /// Leaves that differ in what is seen of them are not, unless there would be too many.
    #[test]
    fn different_leaves_are_merged_only_if_there_are_too_many() {
        let is_light = |at: UVec3| at.element_sum().is_multiple_of(2);
        let striped = grid(|_| 0.3, |at| if is_light(at) { 1.0 } else { -1.0 });
        // Unlike in a checkerboard of these, rays differ in how many of each they cross.
        let uneven = grid(|at| if at.x.is_multiple_of(2) { 0.3 } else { 0.2 }, |_| 0.0);
        for grid in [striped, uneven] {
            assert_eq!(merged(&grid, usize::MAX).leaves(), 65);
            assert_eq!(sizes(&merged(&grid, 2)), [1, 4]);
        }
    }

    /// Of leaves that differ alike, those that are hidden are merged first.
    #[test]
    fn hidden_leaves_are_merged_first() {
        let striped = grid(|_| 0.3, |at| if at.element_sum().is_multiple_of(2) { 1.0 } else { -1.0 });
        let is_hidden = |corner: UVec3| corner.x >= 10;
        let seen: Vec<f32> = striped.voxels().map(|voxel| if is_hidden(voxel.corner) { 1e-9 } else { 1e-6 }).collect();
        let field = to_merged_field(&striped, &seen, 40).unwrap();
        assert!(field.leaves() <= 40, "{}", field.leaves());
        let merged = |cell: &plenoctree::LeafCell| cell.size > 1;
        assert!(field.leaf_cells().filter(merged).all(|cell| is_hidden(cell.corner)));
    }

    proptest! {
        /// There are never more leaves than asked for, and what is not merged stays as it is.
        #[test]
        fn merging_keeps_to_the_limit(
            values in prop::collection::vec((0.05f32..3.0, -3.0f32..3.0, 1e-9f32..1e-6), 65),
            most in 2usize..70,
        ) {
            let at = |corner: UVec3| values[(16 * corner.x + 4 * corner.y + corner.z) as usize % 65];
            let grid = grid(|corner| at(corner).0, |corner| at(corner).1);
            let seen: Vec<f32> = values.iter().map(|(.., seen)| *seen).collect();
            let field = to_merged_field(&grid, &seen, most).unwrap();
            prop_assert!(field.leaves() <= most);
            for cell in field.leaf_cells().filter(|cell| cell.size == 1) {
                let voxel = grid.voxel(cell.corner.as_ivec3()).unwrap() as usize;
                let density = f64::from(field.densities()[cell.leaf as usize]);
                prop_assert!((density / (64.0 * f64::from(grid.thickness[voxel])) - 1.0).abs() < 1e-6);
                let color = field.coefficients()[3 * cell.leaf as usize];
                prop_assert_eq!(color, f16::from_f32(grid.values[voxel].x));
            }
        }
    }
}
