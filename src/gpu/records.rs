//! The octree as shaders traverse it: a dense table of one level, with bricks of 4 x 4 x 4 cells below it.
//!
//! A ray looks up one record per step, and consecutive steps mostly look up the same records. A brick has one bit for
//! each of its 64 cells, set where a leaf begins. Leaves are counted in depth-first order, so the number of bits set
//! before a cell gives the index of its leaf, and no indices are stored. A brick takes 16 bytes, while a node of eight
//! cells would take 32.

use plenoctree::{Cell, PlenOctree};

/// The record of a cell, as `octree.wgsl` reads it: a texel of four words.
///
/// | kind | x, y | z | w, low bits |
/// |---|---|---|---|
/// | empty | how far the empty box around it extends | | level of the empty cell |
/// | brick: parts are finest cells | bits of cells that begin a leaf | first leaf | bits of octants that are one leaf |
/// | inner: parts have child records | bits of parts that are not empty | first child record | the same |
/// | leaf | | leaf | level of the leaf |
///
/// The parts of a cell are the 64 cells two levels below it. The index of a part has six bits: x, y and z of its
/// octant, then x, y and z of the part within the octant. Level `l` has `2^l` cells per side.
///
/// Rays leave the empty boxes around empty cells of the table in one step. Boxes may be larger than the cells of the
/// octree, which end where its levels do. They extend beyond their cell by the given numbers of cells of the table, ten
/// bits per axis: in the first word toward lower coordinates, and in the second toward higher ones. Child records of
/// empty cells extend by 0.
type Record = [u32; 4];

/// The bits of the last word that store the kind.
pub(super) const KIND: u32 = 3 << 30;
const EMPTY: u32 = 0;
pub(super) const BRICK: u32 = 1 << 30;
pub(super) const INNER: u32 = 2 << 30;
pub(super) const LEAF: u32 = 3 << 30;

/// The deepest level that the table may list: 256 texels per side.
const MOST_TABLE_LEVEL: u32 = 8;
// Extents have ten bits.
const _: () = assert!(1 << MOST_TABLE_LEVEL <= 1 << 10);
/// The size that the table may always have, in bytes.
const TABLE_ALLOWANCE: u64 = 4 << 20;

/// Returns the depth of the octree that shaders traverse, which is at least two.
pub(crate) fn tree_depth(field: &PlenOctree) -> u32 {
    field.depth().max(2)
}

#[derive(Default)]
pub(super) struct Records {
    /// The depth of the tree, at least two.
    pub depth: u32,
    /// The level whose cells the table lists.
    pub table_level: u32,
    /// The table records: one for every cell of that level, with z varying fastest.
    pub table: Vec<Record>,
    /// The child records that inner records point to.
    pub children: Vec<Record>,
}

impl Records {
    /// Creates the records of a field, with a table of at most `allowance` bytes (or 4 MiB, if that is more).
    pub fn new(field: &PlenOctree, allowance: u64) -> Self {
        let depth = tree_depth(field);
        let table_level = table_level(depth, allowance);
        let mut records =
            Self { depth, table_level, table: vec![[EMPTY; 4]; 1 << (3 * table_level)], children: Vec::new() };
        let mut empty = Vec::new();
        records.fill(field, Content::Node(0), 0, [0; 3], &mut empty);
        records.extend_empty(&empty);
        records
    }

    /// Returns the size of the table records and child records of a field, in bytes, without creating them.
    pub fn bytes(field: &PlenOctree, allowance: u64) -> u64 {
        let level = table_level(tree_depth(field), allowance);
        16 * ((1 << (3 * level)) + Self::child_count(field, allowance) as u64)
    }

    /// Returns the number of child records of a field, without creating them.
    pub fn child_count(field: &PlenOctree, allowance: u64) -> usize {
        let depth = tree_depth(field);
        count_children(field, 0, 0, table_level(depth, allowance), depth)
    }

    /// Returns how many levels of child records there are below the table.
    pub fn inner_levels(&self) -> u32 {
        if self.children.is_empty() { 0 } else { (self.depth - self.table_level) / 2 - 1 }
    }

    fn fill(&mut self, field: &PlenOctree, part: Content, level: u32, corner: [u32; 3], empty: &mut Vec<Cube>) {
        if level < self.table_level
            && let Content::Node(node) = part
        {
            for (index, cell) in field.nodes()[node as usize].iter().enumerate() {
                let bits = [index as u32 >> 2, (index as u32 >> 1) & 1, index as u32 & 1];
                let corner = std::array::from_fn(|axis| 2 * corner[axis] + bits[axis]);
                self.fill(field, (*cell).into(), level + 1, corner, empty);
            }
            return;
        }
        let record = self.record(field, part, level);
        // A cell above the table's level fills several of its entries.
        let width = 1 << (self.table_level - level);
        let cube = Cube { corner: corner.map(|c| c * width), width };
        if record[3] & KIND == EMPTY {
            empty.push(cube);
        }
        self.set(cube, record);
    }

    fn set(&mut self, cube: Cube, record: Record) {
        let (width, side) = (cube.width as usize, 1usize << self.table_level);
        let [x, y, z] = cube.corner.map(|c| c as usize);
        for (x, y) in (x..x + width).flat_map(|x| (y..y + width).map(move |y| (x, y))) {
            self.table[(x * side + y) * side + z..][..width].fill(record);
        }
    }

    /// Grows a box around each empty cell of the table, one layer of cells after another.
    fn extend_empty(&mut self, empty: &[Cube]) {
        let occupied = Occupied::new(&self.table, 1 << self.table_level);
        for cube in empty {
            let (mut low, mut high) = (cube.corner, cube.corner.map(|c| c + cube.width));
            let mut grows = [true; 6];
            while grows.contains(&true) {
                for (face, grows) in grows.iter_mut().enumerate().filter(|(_, grows)| **grows) {
                    let (axis, is_low) = (face / 2, face % 2 == 0);
                    // The layer of cells beyond this face.
                    let (mut from, mut to) = (low, high);
                    if is_low {
                        (from[axis], to[axis]) = (low[axis].saturating_sub(1), low[axis]);
                    } else {
                        (from[axis], to[axis]) = (high[axis], (high[axis] + 1).min(occupied.side));
                    }
                    *grows = from[axis] < to[axis] && !occupied.any(from, to);
                    if *grows && is_low {
                        low = from;
                    } else if *grows {
                        high = to;
                    }
                }
            }
            let below = std::array::from_fn(|axis| cube.corner[axis] - low[axis]);
            let above = std::array::from_fn(|axis| high[axis] - cube.corner[axis] - cube.width);
            let level = self.table_level - cube.width.ilog2();
            self.set(*cube, [packed(below), packed(above), 0, EMPTY | level]);
        }
    }

    fn record(&mut self, field: &PlenOctree, part: Content, level: u32) -> Record {
        let node = match part {
            Content::Empty => return [0, 0, 0, EMPTY | level],
            Content::Leaf(leaf) => return [0, 0, leaf, LEAF | level],
            Content::Node(node) => &field.nodes()[node as usize],
        };
        // The 64 parts by octant, and whether each octant is a single leaf, which then counts as its first part.
        let octants = node.map(|cell| match cell.into() {
            Content::Node(node) => (field.nodes()[node as usize].map(Content::from), false),
            leaf @ Content::Leaf(_) => {
                let mut parts = [Content::Empty; 8];
                parts[0] = leaf;
                (parts, true)
            }
            Content::Empty => ([Content::Empty; 8], false),
        });
        let (mut mask, mut merged) = (0u64, 0);
        for (octant, (parts, is_leaf)) in octants.iter().enumerate() {
            merged |= u32::from(*is_leaf) << octant;
            for (index, _) in parts.iter().enumerate().filter(|(_, part)| !matches!(part, Content::Empty)) {
                mask |= 1 << (8 * octant + index);
            }
        }
        if level + 2 == self.depth {
            let first = octants.iter().flat_map(|(parts, _)| parts).find_map(|part| match part {
                Content::Leaf(leaf) => Some(*leaf),
                _ => None,
            });
            return match first {
                Some(leaf) => [mask as u32, (mask >> 32) as u32, leaf, BRICK | merged],
                None => [0, 0, 0, EMPTY | level],
            };
        }
        let first = self.children.len();
        self.children.resize(first + mask.count_ones() as usize, [EMPTY; 4]);
        let mut next = first;
        for (parts, is_leaf) in octants {
            for part in parts.into_iter().filter(|part| !matches!(part, Content::Empty)) {
                self.children[next] = self.record(field, part, level + if is_leaf { 1 } else { 2 });
                next += 1;
            }
        }
        [mask as u32, (mask >> 32) as u32, first as u32, INNER | merged]
    }
}

/// A cell of the octree that consists of cells of the table, in whose units it is given.
#[derive(Clone, Copy)]
struct Cube {
    corner: [u32; 3],
    width: u32,
}

/// Packs numbers below 1024.
fn packed(extents: [u32; 3]) -> u32 {
    extents[0] | extents[1] << 10 | extents[2] << 20
}

/// Tells which boxes of cells of the table are empty, no matter how large they are.
struct Occupied {
    side: u32,
    /// For every corner, the number of occupied cells whose coordinates are all below it.
    counts: Vec<u32>,
}

impl Occupied {
    fn new(table: &[Record], side: u32) -> Self {
        let mut occupied = Self { side, counts: vec![0; (side as usize + 1).pow(3)] };
        let mut cells = table.iter();
        for (x, y) in (1..=side).flat_map(|x| (1..=side).map(move |y| (x, y))) {
            let mut row = 0;
            for (z, record) in (1..=side).zip(&mut cells) {
                row += u32::from(record[3] & KIND != EMPTY);
                let before = occupied.below([x - 1, y, z]) + occupied.below([x, y - 1, z]);
                let count = row + before - occupied.below([x - 1, y - 1, z]);
                let at = occupied.index([x, y, z]);
                occupied.counts[at] = count;
            }
        }
        occupied
    }

    fn index(&self, [x, y, z]: [u32; 3]) -> usize {
        let side = self.side as usize + 1;
        (x as usize * side + y as usize) * side + z as usize
    }

    fn below(&self, corner: [u32; 3]) -> u32 {
        self.counts[self.index(corner)]
    }

    /// Returns whether a box has occupied cells.
    fn any(&self, low: [u32; 3], high: [u32; 3]) -> bool {
        let column = |x, y| self.below([x, y, high[2]]) - self.below([x, y, low[2]]);
        column(high[0], high[1]) + column(low[0], low[1]) != column(low[0], high[1]) + column(high[0], low[1])
    }
}

/// Returns the number of child records of a node and of everything below it.
fn count_children(field: &PlenOctree, node: u32, level: u32, table_level: u32, depth: u32) -> usize {
    let cells = field.nodes()[node as usize].iter().map(|cell| Content::from(*cell));
    let count = |node, level| count_children(field, node, level, table_level, depth);
    if level < table_level {
        return cells.map(|part| if let Content::Node(node) = part { count(node, level + 1) } else { 0 }).sum();
    }
    if level + 2 >= depth {
        return 0;
    }
    let octant = |part| match part {
        Content::Empty => 0,
        Content::Leaf(_) => 1,
        Content::Node(node) => {
            let parts = field.nodes()[node as usize].iter().map(|cell| Content::from(*cell));
            let part = |part| match part {
                Content::Empty => 0,
                Content::Leaf(_) => 1,
                Content::Node(node) => 1 + count(node, level + 2),
            };
            parts.map(part).sum()
        }
    };
    cells.map(octant).sum()
}

/// The content of a cell.
#[derive(Clone, Copy)]
enum Content {
    Empty,
    Leaf(u32),
    Node(u32),
}

impl From<Cell> for Content {
    fn from(cell: Cell) -> Self {
        match (cell.as_node(), cell.as_leaf()) {
            (Some(node), _) => Self::Node(node),
            (_, Some(leaf)) => Self::Leaf(leaf),
            _ => Self::Empty,
        }
    }
}

/// Returns the deepest level whose table fits. Bricks are at that level or an even number of levels below it.
fn table_level(depth: u32, allowance: u64) -> u32 {
    let allowance = allowance.max(TABLE_ALLOWANCE);
    let mut level = depth - 2;
    while level >= 2 && (level > MOST_TABLE_LEVEL || 16 << (3 * level) > allowance) {
        level -= 2;
    }
    level
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec3, UVec3};
    use half::f16;
    use plenoctree::{Activation, Basis, Frame, LeafCell, UpAxis};
    use proptest::prelude::*;

    /// Finds the leaf at `position` as the shader does. Also returns its cell, or an empty box, in finest cells.
    fn locate(records: &Records, position: UVec3) -> (Option<u32>, [UVec3; 2]) {
        let cell = |shift: u32| [(position >> shift) << shift, ((position >> shift) + 1) << shift];
        let mut shift = records.depth - records.table_level;
        let [x, y, z] = (position >> shift).to_array().map(|c| c as usize);
        let side = 1 << records.table_level;
        let mut record = records.table[(x * side + y) * side + z];
        loop {
            let at = |bit: u32| {
                let q = (position >> bit) & 1;
                4 * q.x + 2 * q.y + q.z
            };
            let mask = u64::from(record[1]) << 32 | u64::from(record[0]);
            let kind = record[3] & KIND;
            if kind == EMPTY || kind == LEAF {
                let [low, high] = cell(records.depth - (record[3] & 31));
                let extents = |word: u32| (UVec3::splat(word) >> UVec3::new(0, 10, 20)) & 1023;
                let [below, above] =
                    [record[0], record[1]].map(|word| extents(word) << (records.depth - records.table_level));
                return ((kind == LEAF).then_some(record[2]), [low - below, high + above]);
            }
            shift -= 2;
            let (octant, part) = (at(shift + 1), at(shift));
            let is_merged = record[3] >> octant & 1 == 1;
            let index = 8 * octant + if is_merged { 0 } else { part };
            let is_octant = is_merged || mask >> (8 * octant) & 0xff == 0;
            let filled = (mask >> index & 1 == 1).then(|| record[2] + (mask & ((1 << index) - 1)).count_ones());
            match filled {
                Some(child) if kind == INNER => record = records.children[child as usize],
                leaf => return (leaf, cell(shift + u32::from(is_octant))),
            }
        }
    }

    /// Creates a tree whose cells are divided, empty or leaves, as chosen by `choices`.
    fn tree(choices: &[u8], depth: u32) -> PlenOctree {
        let (mut nodes, mut leaves, mut choices) = (vec![[Cell::EMPTY; 8]], 0, choices.iter().cycle());
        let mut open = vec![(0usize, 1)];
        while let Some((node, level)) = open.pop() {
            for index in 0..8 {
                let choice = choices.next().copied().unwrap_or(0);
                if choice < 40 && level < depth && nodes.len() < 4000 {
                    nodes[node][index] = Cell::node(nodes.len() as u32);
                    open.push((nodes.len(), level + 1));
                    nodes.push([Cell::EMPTY; 8]);
                } else if choice < 120 {
                    nodes[node][index] = Cell::leaf(leaves);
                    leaves += 1;
                }
            }
        }
        let count = leaves as usize;
        let frame = Frame::spanning(DVec3::ZERO, DVec3::ONE);
        let coefficients = vec![f16::ONE; 3 * count];
        let density = (0..count).map(|leaf| 1.0 + leaf as f32).collect();
        PlenOctree::new(frame, Basis::Rgba, Activation::Identity, UpAxis::Y, nodes, density, coefficients).unwrap()
    }

    proptest! {
        /// Records hold the same leaves as the octree, and no box that rays skip as empty overlaps a leaf.
        #[test]
        fn records_say_what_the_octree_says(
            choices in prop::collection::vec(any::<u8>(), 64..600),
            depth in 1u32..=11,
            points in prop::collection::vec(any::<[u32; 3]>(), 50),
        ) {
            let field = tree(&choices, depth);
            let records = Records::new(&field, 0);
            prop_assert_eq!(Records::child_count(&field, 0), records.children.len());
            let scale = 1 << (records.depth - field.depth());
            for leaf in field.leaf_cells() {
                let cell = [leaf.corner, leaf.corner + leaf.size].map(|corner| corner * scale);
                prop_assert_eq!(locate(&records, leaf.corner * scale), (Some(leaf.leaf), cell));
            }
            for point in points {
                let position = UVec3::from(point) & ((1 << records.depth) - 1);
                let (leaf, [low, high]) = locate(&records, position);
                prop_assert!(low.cmple(position).all() && high.cmpgt(position).all());
                prop_assert!(high.cmple(UVec3::splat(1 << records.depth)).all());
                prop_assert_eq!(leaf, field.locate(position / scale).0.as_leaf());
                let touches = |cell: LeafCell| {
                    low.cmplt((cell.corner + cell.size) * scale).all() && high.cmpgt(cell.corner * scale).all()
                };
                prop_assert!(leaf.is_some() || !field.leaf_cells().any(touches));
            }
        }
    }
}
