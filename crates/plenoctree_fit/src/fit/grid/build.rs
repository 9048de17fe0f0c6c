//! Builds grids from sets of voxels.

use glam::{IVec3, UVec3, Vec4};

use super::sparse::{BRICK, Brick, Cube, FREE, Grid, NO_VOXEL, bit_of, place_of};

/// Largest distance that an entry of the table stores.
const FARTHEST: u32 = 255;

/// A set of voxels: a bit for each voxel of each brick.
#[derive(Clone)]
pub struct VoxelSet {
    resolution: u32,
    masks: Vec<u64>,
}

impl VoxelSet {
    /// Creates an empty set. `resolution` is the number of voxels per side, a multiple of 4.
    pub fn new(resolution: u32) -> Self {
        let side = (resolution / BRICK) as usize;
        Self { resolution, masks: vec![0; side.pow(3)] }
    }

    pub fn insert(&mut self, position: UVec3) {
        let index = self.index(position / BRICK);
        self.masks[index] |= 1 << bit_of(position % BRICK);
    }

    /// Adds the voxel and its 26 neighbors.
    pub fn insert_around(&mut self, position: UVec3) {
        let high = (position + 1).min(UVec3::splat(self.resolution - 1));
        let low = position.saturating_sub(UVec3::ONE);
        for x in low.x..=high.x {
            for y in low.y..=high.y {
                for z in low.z..=high.z {
                    self.insert(UVec3::new(x, y, z));
                }
            }
        }
    }

    /// Adds the eight voxels that make up the voxel at `position` of a grid with half the resolution.
    pub fn insert_children(&mut self, position: UVec3) {
        for child in 0..8 {
            self.insert(2 * position + UVec3::new(child >> 2, child >> 1 & 1, child & 1));
        }
    }

    /// Returns the positions of all voxels.
    pub fn positions(&self) -> impl Iterator<Item = UVec3> + '_ {
        let side = self.resolution / BRICK;
        self.masks.iter().zip(0u32..).filter(|(mask, _)| **mask != 0).flat_map(move |(mask, index)| {
            let corner = BRICK * UVec3::new(index / (side * side), index / side % side, index % side);
            (0..64).filter(|bit| *mask >> bit & 1 == 1).map(move |bit| corner + place_of(bit))
        })
    }

    fn index(&self, brick: UVec3) -> usize {
        let side = self.resolution / BRICK;
        ((brick.x * side + brick.y) * side + brick.z) as usize
    }
}

impl Grid {
    /// Creates a grid of the voxels in `set`, whose values are all 0.
    pub fn new(cube: Cube, functions: usize, set: &VoxelSet) -> Self {
        let resolution = set.resolution;
        let side = resolution / BRICK;
        let mut table = vec![FREE; set.masks.len()];
        let mut bricks = Vec::new();
        let mut count = 0;
        for (index, &mask) in set.masks.iter().enumerate() {
            if mask != 0 {
                let index32 = index as u32;
                let corner = [index32 / (side * side), index32 / side % side, index32 % side].map(|at| at as u16);
                table[index] = bricks.len() as u32;
                bricks.push(Brick { mask, first: count, corner });
                count += mask.count_ones();
            }
        }
        measure_distances(&mut table, side as usize);
        let count = count as usize;
        let mut grid = Self {
            cube,
            resolution,
            functions,
            table,
            bricks,
            values: vec![Vec4::ZERO; count * functions],
            squares: vec![Vec4::ZERO; count],
            updates: vec![0; count],
            thickness: vec![0.0; count],
            neighbors: Vec::new(),
        };
        grid.neighbors = grid
            .positions()
            .map(|position| {
                [IVec3::NEG_X, IVec3::X, IVec3::NEG_Y, IVec3::Y, IVec3::NEG_Z, IVec3::Z]
                    .map(|offset| grid.voxel(position.as_ivec3() + offset).unwrap_or(NO_VOXEL))
            })
            .collect();
        grid
    }

    /// Returns a grid of the voxels in `set`, which either has this grid's resolution or twice as much. Values are
    /// copied from the voxels of this grid; voxels that it does not have start empty.
    pub fn resampled(&self, set: &VoxelSet) -> Self {
        let finer = set.resolution / self.resolution;
        let functions = self.functions;
        let mut grid = Self::new(self.cube, functions, set);
        let positions: Vec<UVec3> = grid.positions().collect();
        for (index, position) in positions.into_iter().enumerate() {
            let Some(source) = self.voxel((position / finer).as_ivec3()) else { continue };
            let source = source as usize;
            let values = &mut grid.values[index * functions..][..functions];
            values.copy_from_slice(&self.values[source * functions..][..functions]);
            // The same density in smaller voxels.
            values[0].w /= finer as f32;
            grid.thickness[index] = values[0].w;
            if finer == 1 {
                grid.squares[index] = self.squares[source];
                grid.updates[index] = self.updates[source];
            }
        }
        grid
    }
}

/// Replaces every free entry by its Chebyshev distance to the nearest brick: one sweep from each of two opposite
/// corners, over the 13 neighbors already visited.
fn measure_distances(table: &mut [u32], side: usize) {
    let distance = |entry: u32| if entry & FREE == 0 { 0 } else { entry & !FREE };
    for entry in table.iter_mut().filter(|entry| **entry & FREE != 0) {
        *entry = FREE | FARTHEST;
    }
    let at = |place: [usize; 3]| (place[0] * side + place[1]) * side + place[2];
    let seen: Vec<[isize; 3]> = (0..27isize)
        .map(|code| [code / 9 - 1, code / 3 % 3 - 1, code % 3 - 1])
        .filter(|offset| *offset < [0, 0, 0])
        .collect();
    for sign in [1isize, -1] {
        for step in 0..table.len() {
            let index = if sign > 0 { step } else { table.len() - 1 - step };
            if table[index] & FREE == 0 {
                continue;
            }
            let place = [index / (side * side), index / side % side, index % side];
            for offset in &seen {
                let neighbor: [usize; 3] =
                    std::array::from_fn(|axis| place[axis].wrapping_add_signed(sign * offset[axis]));
                if neighbor.iter().all(|&coordinate| coordinate < side) {
                    let through = distance(table[at(neighbor)]) + 1;
                    if through < distance(table[index]) {
                        table[index] = FREE | through;
                    }
                }
            }
        }
    }
}
