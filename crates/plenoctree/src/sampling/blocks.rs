//! The finest cells of a field, laid out so that the rays of all leaves in a block can be marched together.

use std::ops::Range;

use glam::{IVec3, UVec3};

use super::{
    path::{Path, SIDE, Step},
    progress::{Canceled, Progress},
};
use crate::field::{LeafCell, PlenOctree};

/// Rows of a block, one for each x and y, with index `SIDE x + y`.
pub(super) const ROWS: usize = SIDE * SIDE;

/// Optical depths of the rays from the cells of a block, by row and lane. Lanes without a ray are infinite.
pub(super) type Depths = [[f32; SIDE]; ROWS];

/// Densities along z that the eight cells of a row can reach when shifted by up to seven cells.
type Row = [f32; 2 * SIDE];

/// Limits of the memory for blocks: entries of the map (64 MiB), and rows beyond two per leaf (256 MiB).
const MAX_ENTRIES: u64 = 1 << 24;
const MAX_ROWS: u64 = 1 << 22;

/// Densities of the finest cells in blocks of 8 x 8 x 8 cells. Only rows that are not empty are stored.
pub(super) struct Blocks {
    /// Lowest position in the map, in blocks, and number of positions along each axis.
    low: IVec3,
    size: UVec3,
    /// Block at every position, as an index into `blocks`. x varies slowest.
    map: Vec<u32>,
    /// The first block stands for all empty ones.
    blocks: Vec<Block>,
    rows: Vec<Row>,
}

struct Block {
    /// Rows that are not empty, as bits.
    occupied: u64,
    /// Index of the first of them in [`Blocks::rows`].
    first: u32,
    /// Number of occupied rows before each row.
    rank: [u8; ROWS],
}

impl Blocks {
    /// Lays out a field. Returns `None` if the tree is too deep, or its leaves too large, for a lattice of finest
    /// cells.
    pub fn new(field: &PlenOctree, progress: &Progress) -> Result<Option<Self>, Canceled> {
        let side = SIDE as u32;
        let Some((low, high)) = field.cell_bounds() else { return Ok(None) };
        // Rows reach into the next block along z, so the map starts one block before the first leaf.
        let low = (low / side).as_ivec3() - IVec3::Z;
        let size = (((high - 1) / side).as_ivec3() - low + 1).as_uvec3();
        let entries: u64 = size.to_array().into_iter().map(u64::from).product();
        let mut rows = 0;
        for cell in field.leaf_cells() {
            progress.check()?;
            rows += u64::from(cell.size).pow(2) * (u64::from(cell.size / side) + 2);
        }
        if entries > MAX_ENTRIES || rows > MAX_ROWS + 2 * field.leaves() as u64 {
            return Ok(None);
        }
        let mut blocks =
            Self { low, size, map: vec![0; entries as usize], blocks: vec![Block::EMPTY], rows: Vec::new() };
        for (place, row, _) in field.leaf_cells().flat_map(touched_rows) {
            progress.check()?;
            blocks.occupy(place, row);
        }
        let mut count = 0;
        for block in &mut blocks.blocks {
            block.first = count;
            for row in 0..ROWS {
                block.rank[row] = (block.occupied & ((1 << row) - 1)).count_ones() as u8;
            }
            count += block.occupied.count_ones();
        }
        blocks.rows = vec![[0.0; 2 * SIDE]; count as usize];
        for cell in field.leaf_cells() {
            let density = field.densities()[cell.leaf as usize];
            for (place, row, lanes) in touched_rows(cell) {
                progress.check()?;
                let index = blocks.get(place).index(row);
                blocks.rows[index][lanes].fill(density);
            }
        }
        Ok(Some(blocks))
    }

    /// Returns the map's entry for the block at `place`, in blocks, or `None` if it is outside the map.
    fn entry(&self, place: IVec3) -> Option<usize> {
        // Coordinates below the lowest position wrap around, so they fail the comparison too.
        let UVec3 { x, y, z } = (place - self.low).as_uvec3();
        let inside = x < self.size.x && y < self.size.y && z < self.size.z;
        inside.then(|| (x as usize * self.size.y as usize + y as usize) * self.size.z as usize + z as usize)
    }

    fn get(&self, place: IVec3) -> &Block {
        &self.blocks[self.entry(place).map_or(0, |entry| self.map[entry] as usize)]
    }

    fn occupy(&mut self, place: IVec3, row: usize) {
        let Some(entry) = self.entry(place) else { return };
        if self.map[entry] == 0 {
            self.map[entry] = self.blocks.len() as u32;
            self.blocks.push(Block::EMPTY);
        }
        self.blocks[self.map[entry] as usize].occupied |= 1 << row;
    }

    /// Adds the optical depths along `path` to those of the rays from the cells of the block at `place`.
    ///
    /// A row of rays is dropped once all its optical depths are greater than `limit`, or infinite.
    pub fn march(&self, place: IVec3, path: &Path, limit: f32, depths: &mut Depths) {
        let hidden = |row: &[f32; SIDE]| row.iter().fold(true, |all, &depth| all & (depth > limit));
        let mut live = (0..ROWS).filter(|&row| !hidden(&depths[row])).fold(0, |live, row| live | 1 << row);
        for run in &path.runs {
            // The shifted block overlaps two by two blocks. Their rows reach into the blocks above.
            let corner = place + run.blocks;
            let blocks = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(x, y)| self.get(corner + IVec3::new(x, y, 0)));
            if blocks.iter().all(|block| block.occupied == 0) {
                continue;
            }
            for step in &path.steps[run.steps.clone()] {
                self.cross(blocks, step, live, depths);
            }
            for row in bits(live) {
                if hidden(&depths[row]) {
                    live &= !(1 << row);
                }
            }
            if live == 0 {
                return;
            }
        }
    }

    /// Advances the `live` rows of rays by one step.
    fn cross(&self, blocks: [&Block; 4], step: &Step, live: u64, depths: &mut Depths) {
        let [x, y, lane] = step.rest.map(|x| usize::from(x) % SIDE);
        for row in bits(live & occupied(blocks, x, y)) {
            // x and y of the row, four bits each. The highest bit of each selects the block.
            let at = row + row / SIDE * SIDE + x * 2 * SIDE + y;
            let block = blocks[(at >> 6) & 2 | (at >> 3) & 1];
            let densities = &self.rows[block.index((at >> 1) & 0o70 | at & 7)][lane..lane + SIDE];
            for (depth, density) in depths[row].iter_mut().zip(densities) {
                *depth += density * step.length;
            }
        }
    }
}

/// Returns the rows of a block, as bits, that land on occupied rows when the block is shifted by `x` and `y` cells from
/// the first of two by two blocks toward the others.
fn occupied(blocks: [&Block; 4], x: usize, y: usize) -> u64 {
    // In every byte, the bits that do not come from the next block along y.
    let stay = 0x0101_0101_0101_0101 * (0xff_u64 >> y);
    let along_y = |first: &Block, next: &Block| (first.occupied >> y) & stay | (next.occupied << (7 - y) << 1) & !stay;
    let (first, next) = (along_y(blocks[0], blocks[1]), along_y(blocks[2], blocks[3]));
    first >> (8 * x) | next << (8 * (7 - x)) << 8
}

/// Returns the indices of the bits that are set, lowest first.
fn bits(mut set: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lowest = (set != 0).then(|| set.trailing_zeros() as usize);
        set &= set.wrapping_sub(1);
        lowest
    })
}

impl Block {
    const EMPTY: Self = Self { occupied: 0, first: 0, rank: [0; ROWS] };

    /// Returns the index of an occupied row in [`Blocks::rows`].
    fn index(&self, row: usize) -> usize {
        self.first as usize + usize::from(self.rank[row % ROWS])
    }
}

/// Returns the blocks, rows and lanes that a cell covers.
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
