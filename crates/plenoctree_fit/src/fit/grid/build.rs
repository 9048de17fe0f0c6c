//! Builds grids from sets of voxels.

use glam::{IVec3, UVec3, Vec4};

use super::sparse::{BRICK, Brick, Cells, Cube, FREE, Grid, NO_VOXEL, Voxel, bit_of};

/// Largest distance that an entry of the table stores.
const FARTHEST: u32 = 255;

/// A set of voxels that do not overlap.
#[derive(Clone)]
pub struct VoxelSet {
    resolution: u32,
    bricks: Vec<Cells>,
}

impl VoxelSet {
    /// Creates an empty set. `resolution` is the number of cells per side, a multiple of 4.
    pub fn new(resolution: u32) -> Self {
        let side = (resolution / BRICK) as usize;
        Self { resolution, bricks: vec![Cells::default(); side.pow(3)] }
    }

    /// Creates the set of these voxels.
    pub fn of(resolution: u32, voxels: impl IntoIterator<Item = Voxel>) -> Self {
        let mut set = Self::new(resolution);
        voxels.into_iter().for_each(|voxel| set.insert(voxel));
        set
    }

    /// Adds a voxel, and removes those that it covers.
    pub fn insert(&mut self, voxel: Voxel) {
        let index = self.index(voxel.corner / BRICK);
        self.bricks[index].insert(voxel.corner % BRICK, voxel.size);
    }

    /// Returns whether a voxel of the set contains a cell.
    pub fn contains(&self, cell: UVec3) -> bool {
        self.bricks[self.index(cell / BRICK)].filled >> bit_of(cell % BRICK) & 1 == 1
    }

    /// Returns the places of all voxels.
    pub fn voxels(&self) -> impl Iterator<Item = Voxel> + '_ {
        let side = self.resolution / BRICK;
        self.bricks.iter().zip(0u32..).filter(|(cells, _)| cells.voxels != 0).flat_map(move |(cells, index)| {
            let corner = BRICK * UVec3::new(index / (side * side), index / side % side, index % side);
            cells.places(corner)
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
        let mut table = vec![FREE; set.bricks.len()];
        let mut bricks = Vec::new();
        let mut count = 0;
        for (index, &cells) in set.bricks.iter().enumerate() {
            if cells.voxels != 0 {
                let index32 = index as u32;
                let corner = [index32 / (side * side), index32 / side % side, index32 % side].map(|at| at as u16);
                table[index] = bricks.len() as u32;
                bricks.push(Brick { cells, first: count, corner });
                count += cells.voxels.count_ones();
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
        grid.neighbors = (grid.voxels())
            .map(|Voxel { corner, size }| {
                let (low, size) = (corner.as_ivec3(), size as i32);
                [IVec3::NEG_X, size * IVec3::X, IVec3::NEG_Y, size * IVec3::Y, IVec3::NEG_Z, size * IVec3::Z]
                    .map(|offset| grid.voxel(low + offset).unwrap_or(NO_VOXEL))
            })
            .collect();
        grid
    }

    /// Returns a grid of the voxels in `set`, which either has this grid's resolution or twice as much. No voxel is
    /// larger than the one of this grid at its place, whose values it gets; where there is none, it starts empty.
    pub fn resampled(&self, set: &VoxelSet) -> Self {
        let finer = set.resolution / self.resolution;
        let functions = self.functions;
        let mut grid = Self::new(self.cube, functions, set);
        for (index, voxel) in set.voxels().enumerate() {
            let Some(source) = self.voxel((voxel.corner / finer).as_ivec3()) else { continue };
            let source = source as usize;
            let values = &mut grid.values[index * functions..][..functions];
            values.copy_from_slice(&self.values[source * functions..][..functions]);
            // The same density in smaller cells.
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
