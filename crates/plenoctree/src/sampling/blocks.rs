//! The finest cells of a field, laid out so that the rays of all leaves in a block can be marched together.

use glam::{IVec3, UVec3};

use super::{
    path::{Path, SIDE, Step},
    progress::{Canceled, Progress},
};
use crate::field::PlenOctree;

/// Rows of a block, one for each x and y, with index `SIDE x + y`.
pub(super) const ROWS: usize = SIDE * SIDE;

/// Optical depths of the rays from the cells of a block, by row and lane. Lanes without a ray are infinite.
pub(super) type Depths = [[f32; SIDE]; ROWS];

/// Densities along z that the eight cells of a row can reach when shifted by up to seven cells.
type Row = [f32; 2 * SIDE];

/// Limits of the memory for blocks: entries of the map (64 MiB), and rows beyond two per leaf (256 MiB).
const MAX_ENTRIES: u64 = 1 << 24;
const MAX_ROWS: u64 = 1 << 22;

/// Densities of the finest cells in blocks of 8 x 8 x 8 cells. Larger leaves are many cells. Only rows that are not
/// empty are stored, and rows next to each other that are equal are stored once.
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
    /// Index of the first of its rows in [`Blocks::rows`].
    first: u32,
    /// Index of each row, counted from the first.
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
        if entries > MAX_ENTRIES {
            return Ok(None);
        }
        let most = MAX_ROWS + 2 * field.leaves() as u64;
        let mut blocks =
            Self { low, size, map: vec![0; entries as usize], blocks: vec![Block::EMPTY], rows: Vec::new() };
        let (mut own, mut above) = ([0.0; SIDE * ROWS], [0.0; SIDE * ROWS]);
        let mut entry = 0;
        for x in 0..size.x {
            for y in 0..size.y {
                // From the top down, so that each block is read once.
                above.fill(0.0);
                for z in (0..size.z).rev() {
                    progress.check()?;
                    let filled = read_block(field, low + UVec3::new(x, y, z).as_ivec3(), &mut own);
                    if filled || above.iter().any(|density| *density > 0.0) {
                        blocks.map[entry + z as usize] = blocks.blocks.len() as u32;
                        blocks.push(&own, &above);
                    }
                    std::mem::swap(&mut own, &mut above);
                }
                if blocks.rows.len() as u64 > most {
                    return Ok(None);
                }
                entry += size.z as usize;
            }
        }
        Ok(Some(blocks))
    }

    /// Adds a block with the densities of its cells and of those of the next block along z.
    fn push(&mut self, own: &[f32; SIDE * ROWS], above: &[f32; SIDE * ROWS]) {
        let first = self.rows.len();
        let mut block = Block { first: first as u32, ..Block::EMPTY };
        for row in 0..ROWS {
            let mut densities = [0.0; 2 * SIDE];
            densities[..SIDE].copy_from_slice(&own[SIDE * row..][..SIDE]);
            densities[SIDE..].copy_from_slice(&above[SIDE * row..][..SIDE]);
            if densities.iter().all(|density| *density == 0.0) {
                continue;
            }
            block.occupied |= 1 << row;
            // The rows before it along x and along y.
            let before = [(row % SIDE > 0).then(|| row - 1), row.checked_sub(SIDE)];
            let mut equal = before.into_iter().flatten().filter(|row| block.occupied >> row & 1 == 1);
            let same = equal.find(|row| self.rows[block.index(*row)] == densities);
            block.rank[row] = same.map_or((self.rows.len() - first) as u8, |row| block.rank[row]);
            if same.is_none() {
                self.rows.push(densities);
            }
        }
        self.blocks.push(block);
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

    /// Adds the optical depths along `path`, without its first `skipped` steps, to those of the rays from the cells of
    /// the block at `place`.
    ///
    /// A row of rays is dropped once all its optical depths are greater than `limit`, or infinite.
    pub fn march(&self, place: IVec3, path: &Path, skipped: usize, limit: f32, depths: &mut Depths) {
        let hidden = |row: &[f32; SIDE]| row.iter().fold(true, |all, &depth| all & (depth > limit));
        let mut live = (0..ROWS).filter(|&row| !hidden(&depths[row])).fold(0, |live, row| live | 1 << row);
        for run in path.runs.iter().filter(|run| run.steps.end > skipped) {
            // The shifted block overlaps two by two blocks. Their rows reach into the blocks above.
            let corner = place + run.blocks;
            let blocks = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(x, y)| self.get(corner + IVec3::new(x, y, 0)));
            if blocks.iter().all(|block| block.occupied == 0) {
                continue;
            }
            for step in &path.steps[run.steps.start.max(skipped)..run.steps.end] {
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

/// Reads the densities of the block at `place`, in blocks. Returns whether there are any.
fn read_block(field: &PlenOctree, place: IVec3, densities: &mut [f32; SIDE * ROWS]) -> bool {
    densities.fill(0.0);
    let (side, depth) = (SIDE as u32, field.depth());
    if place.min_element() < 0 || (place.as_uvec3() * side).max_element() >= 1 << depth {
        return false;
    }
    let corner = place.as_uvec3() * side;
    // The cell of the block, or the leaf around it, or the root of a smaller tree.
    let (mut node, mut level) = (0, depth);
    while level > SIDE.ilog2() {
        level -= 1;
        let part = (corner >> level) & UVec3::ONE;
        let cell = field.nodes()[node as usize][(4 * part.x + 2 * part.y + part.z) as usize];
        match cell.as_node() {
            Some(child) => node = child,
            None => {
                let density = cell.as_leaf().map_or(0.0, |leaf| field.densities()[leaf as usize]);
                densities.fill(density);
                return density > 0.0;
            }
        }
    }
    field.visit_cells(node, UVec3::ZERO, 1 << level, &mut |cell, corner, width| {
        let Some(leaf) = cell.as_leaf() else { return };
        let ([x, y, z], width) = (corner.to_array().map(|at| at as usize), width as usize);
        for row in (x..x + width).flat_map(|x| (y..y + width).map(move |y| SIDE * x + y)) {
            densities[SIDE * row + z..][..width].fill(field.densities()[leaf as usize]);
        }
    });
    true
}
