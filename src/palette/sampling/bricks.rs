//! The finest cells of a field, laid out so that the rays of a block of leaves can be marched together.

use std::ops::Range;

use glam::{IVec3, UVec3};

use super::path::{Path, Step};
use crate::field::{LeafCell, PlenOctree};

/// Finest cells along the side of a brick.
pub(super) const SIDE: usize = 8;

/// Rows of a brick: one for each x and y, in the order `SIDE x + y`.
pub(super) const ROWS: usize = SIDE * SIDE;

/// Optical depths of the rays that leave the cells of a brick, by row and lane. Lanes without a ray are infinite.
pub(super) type Depths = [[f32; SIDE]; ROWS];

/// The densities along z that the eight cells of a row can reach by moving on by up to seven.
type Row = [f32; 2 * SIDE];

/// Entries of the map, and rows beyond two for each leaf, that are worth their memory (64 MiB and 256 MiB).
const MOST_ENTRIES: u64 = 1 << 24;
const MOST_ROWS: u64 = 1 << 22;

/// Densities of the finest cells in bricks of 8 x 8 x 8, of which only rows that are not empty are kept.
#[derive(Default)]
pub(super) struct Bricks {
    /// The lowest place of the map, in bricks, and the number of places along each axis.
    low: IVec3,
    size: UVec3,
    /// The brick at every place, x slowest, as an index into `bricks` plus one; 0 where there is none.
    map: Vec<u32>,
    bricks: Vec<Brick>,
    rows: Vec<Row>,
}

struct Brick {
    /// The rows that are not empty, as bits.
    occupied: u64,
    /// Where the first of them is kept.
    first: u32,
    /// The number of occupied rows before each.
    rank: [u8; ROWS],
}

impl Bricks {
    /// Lays out a field; `None` if its tree is too deep, or its leaves too coarse, for a lattice of finest cells.
    pub fn new(field: &PlenOctree) -> Option<Self> {
        let side = SIDE as u32;
        let (low, high) = field.cell_bounds()?;
        // Rows reach into the next brick along z, so the first begins a brick before the first leaf.
        let low = (low / side).as_ivec3() - IVec3::Z;
        let size = (((high - 1) / side).as_ivec3() - low + 1).as_uvec3();
        let entries: u64 = size.to_array().into_iter().map(u64::from).product();
        let rows: u64 =
            field.leaf_cells().map(|cell| u64::from(cell.size).pow(2) * (u64::from(cell.size / side) + 2)).sum();
        if entries > MOST_ENTRIES || rows > MOST_ROWS + 2 * field.leaves() as u64 {
            return None;
        }
        let mut bricks = Self { low, size, map: vec![0; entries as usize], bricks: Vec::new(), rows: Vec::new() };
        for (place, row, _) in field.leaf_cells().flat_map(touched_rows) {
            bricks.occupy(place, row);
        }
        let mut count = 0;
        for brick in &mut bricks.bricks {
            brick.first = count;
            for row in 0..ROWS {
                brick.rank[row] = (brick.occupied & ((1 << row) - 1)).count_ones() as u8;
            }
            count += brick.occupied.count_ones();
        }
        bricks.rows = vec![[0.0; 2 * SIDE]; count as usize];
        for cell in field.leaf_cells() {
            let density = field.densities()[cell.leaf as usize];
            for (place, row, lanes) in touched_rows(cell) {
                if let Some(index) = bricks.get(place).map(|brick| brick.index(row)) {
                    bricks.rows[index][lanes].fill(density);
                }
            }
        }
        Some(bricks)
    }

    /// Where the map has the brick at `place`, in bricks.
    fn entry(&self, place: IVec3) -> Option<usize> {
        // What is below the lowest place becomes larger than any.
        let UVec3 { x, y, z } = (place - self.low).as_uvec3();
        let inside = x < self.size.x && y < self.size.y && z < self.size.z;
        inside.then(|| (x as usize * self.size.y as usize + y as usize) * self.size.z as usize + z as usize)
    }

    fn get(&self, place: IVec3) -> Option<&Brick> {
        self.bricks.get((self.map[self.entry(place)?] as usize).wrapping_sub(1))
    }

    fn occupy(&mut self, place: IVec3, row: usize) {
        let Some(entry) = self.entry(place) else { return };
        if self.map[entry] == 0 {
            self.bricks.push(Brick { occupied: 0, first: 0, rank: [0; ROWS] });
            self.map[entry] = self.bricks.len() as u32;
        }
        self.bricks[self.map[entry] as usize - 1].occupied |= 1 << row;
    }

    /// Adds the optical depths along `path` to those of the rays from the cells of the brick at `place`.
    ///
    /// A row of rays is given up once all are deeper than `limit`, or infinite.
    pub fn march(&self, place: IVec3, path: &Path, limit: f32, depths: &mut Depths) {
        let hidden = |row: &[f32; SIDE]| row.iter().all(|&depth| depth > limit);
        let mut live = (0..ROWS).filter(|&row| !hidden(&depths[row])).fold(0, |live, row| live | 1 << row);
        for run in &path.runs {
            let corner = place + run.bricks;
            // The cells that the block has moved to lie in two by two bricks, or rather in their rows.
            let bricks = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(x, y)| self.get(corner + IVec3::new(x, y, 0)));
            if bricks.iter().all(Option::is_none) {
                continue;
            }
            for step in &path.steps[run.steps.clone()] {
                for (quadrant, brick) in bricks.iter().enumerate() {
                    if let Some(brick) = brick {
                        self.cross(brick, quadrant, step, live, depths);
                    }
                }
            }
            let mut rest = live;
            while rest != 0 {
                let row = rest.trailing_zeros() as usize;
                rest &= rest - 1;
                if hidden(&depths[row]) {
                    live &= !(1 << row);
                }
            }
            if live == 0 {
                return;
            }
        }
    }

    /// The part of a step that leads into one of the four bricks that the block lies in by now.
    fn cross(&self, brick: &Brick, quadrant: usize, step: &Step, live: u64, depths: &mut Depths) {
        let (moved, mask) = step.into_quadrant(quadrant);
        // Rows of the brick, renumbered as the rows of the block that lie on them.
        let onto = if moved >= 0 { brick.occupied >> moved } else { brick.occupied << -moved };
        let mut rows = live & mask & onto;
        let lane = usize::from(step.lane) % SIDE;
        while rows != 0 {
            let row = rows.trailing_zeros() as usize;
            rows &= rows - 1;
            let densities = &self.rows[brick.index((row as i32 + moved) as usize)][lane..lane + SIDE];
            for (depth, density) in depths[row].iter_mut().zip(densities) {
                *depth += density * step.length;
            }
        }
    }
}

impl Brick {
    /// Where an occupied row is kept.
    fn index(&self, row: usize) -> usize {
        self.first as usize + usize::from(self.rank[row % ROWS])
    }
}

/// The bricks and rows that hold a cell, and in which lanes.
fn touched_rows(cell: LeafCell) -> impl Iterator<Item = (IVec3, usize, Range<usize>)> {
    let side = SIDE as i32;
    let (low, size) = (cell.corner.as_ivec3(), cell.size as i32);
    let columns = (low.x..low.x + size).flat_map(move |x| (low.y..low.y + size).map(move |y| (x, y)));
    columns.flat_map(move |(x, y)| {
        ((low.z / side - 1)..=((low.z + size - 1) / side)).map(move |z| {
            let lane = |at: i32| (at - z * side).clamp(0, 2 * side) as usize;
            (IVec3::new(x / side, y / side, z), (x % side * side + y % side) as usize, lane(low.z)..lane(low.z + size))
        })
    })
}
