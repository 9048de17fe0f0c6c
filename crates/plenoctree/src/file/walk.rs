//! Converts the `child` array of a file to nodes in depth-first order.

use crate::field::{Cell, InvalidField, MAX_DEPTH};

/// Marks cells without a leaf in [`Tree::slots`].
const NO_LEAF: i32 = -1;

/// The tree of a file, and the leaf of every cell in the file.
pub(super) struct Tree {
    /// The nodes that the root reaches, in depth-first order.
    pub nodes: Vec<[Cell; 8]>,
    /// Number of leaves in `nodes`, which are numbered in depth-first order.
    pub leaves: usize,
    /// The leaf of every cell in the file, or a negative number.
    slots: Vec<i32>,
}

impl Tree {
    /// Walks the tree from the root.
    ///
    /// `child` holds the offset from each cell's node to its child node, or 0 if the cell is not subdivided. Every cell
    /// that is not subdivided counts as a leaf until [`Self::keep`] drops the empty ones.
    pub fn walk(mut child: Vec<i32>) -> Result<Self, InvalidField> {
        struct Visit {
            file: usize,
            node: usize,
            next: usize,
        }
        let count = child.len() / 8;
        if count == 0 {
            return Err(InvalidField::Dangling { node: 0 });
        }
        let mut reached = vec![false; count];
        reached[0] = true;
        let mut nodes = vec![[Cell::EMPTY; 8]];
        let mut leaves = 0;
        let mut stack = vec![Visit { file: 0, node: 0, next: 0 }];
        while let Some(Visit { file, node, next }) = stack.last_mut() {
            if *next == 8 {
                stack.pop();
                continue;
            }
            let (file, node, cell) = (*file, *node, std::mem::replace(next, *next + 1));
            let slot = &mut child[8 * file + cell];
            if *slot == 0 {
                *slot = leaves as i32;
                nodes[node][cell] = Cell::leaf(leaves);
                leaves += 1;
                continue;
            }
            let offset = std::mem::replace(slot, NO_LEAF);
            let below = usize::try_from(file as i64 + i64::from(offset)).unwrap_or(usize::MAX);
            if below >= count {
                return Err(InvalidField::Dangling { node: file as u32 });
            }
            if std::mem::replace(&mut reached[below], true) {
                return Err(InvalidField::Shared { node: below as u32 });
            }
            if stack.len() >= MAX_DEPTH as usize {
                return Err(InvalidField::TooDeep);
            }
            nodes[node][cell] = Cell::node(nodes.len() as u32);
            stack.push(Visit { file: below, node: nodes.len(), next: 0 });
            nodes.push([Cell::EMPTY; 8]);
        }
        for (slots, _) in child.chunks_exact_mut(8).zip(&reached).filter(|(_, reached)| !**reached) {
            slots.fill(NO_LEAF);
        }
        nodes.shrink_to_fit();
        Ok(Self { nodes, leaves: leaves as usize, slots: child })
    }

    /// Returns the leaf of a cell in the file.
    pub fn leaf(&self, cell: usize) -> Option<usize> {
        usize::try_from(self.slots[cell]).ok()
    }

    /// Returns the number of cells in the file.
    pub fn cells(&self) -> usize {
        self.slots.len()
    }

    /// Returns the number of nodes in the file.
    pub fn file_nodes(&self) -> u64 {
        (self.slots.len() / 8) as u64
    }

    /// Returns the end of the cells that hold leaves: one past the last of them in the file.
    pub fn end(&self) -> usize {
        self.slots.iter().rposition(|&slot| slot != NO_LEAF).map_or(0, |last| last + 1)
    }

    /// Keeps the leaves whose density passes `keep`, renumbers them, and returns their densities.
    pub fn keep(&mut self, mut density: Vec<f32>, keep: impl Fn(f32) -> bool) -> Vec<f32> {
        let mut kept = 0;
        let renumbered: Vec<i32> = density
            .iter()
            .map(|&density| {
                let leaf = if keep(density) { kept } else { NO_LEAF };
                kept += i32::from(leaf != NO_LEAF);
                leaf
            })
            .collect();
        for slot in self.slots.iter_mut().filter(|slot| **slot != NO_LEAF) {
            *slot = renumbered[*slot as usize];
        }
        for cell in self.nodes.as_flattened_mut() {
            if let Some(leaf) = cell.as_leaf() {
                *cell = u32::try_from(renumbered[leaf as usize]).map_or(Cell::EMPTY, Cell::leaf);
            }
        }
        density.retain(|&density| keep(density));
        density.shrink_to_fit();
        self.leaves = density.len();
        density
    }
}
