//! Cells of the octree.

use glam::UVec3;

/// One of a node's eight cells, packed as shaders read it: 0 is empty, the high bit marks a leaf, the rest is an index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub struct Cell(u32);

impl Cell {
    /// A cell without density.
    pub const EMPTY: Self = Self(0);
    const LEAF: u32 = 1 << 31;

    /// A cell that is divided; `index` is that of the node that holds its parts, at least 1 (the root is nobody's part).
    pub fn node(index: u32) -> Self {
        debug_assert!(index > 0 && index < Self::LEAF);
        Self(index)
    }

    /// A cell that holds density; `index` counts leaves.
    pub fn leaf(index: u32) -> Self {
        debug_assert!(index < Self::LEAF);
        Self(Self::LEAF | index)
    }

    /// The index of the node below, if the cell is divided.
    pub fn as_node(self) -> Option<u32> {
        (self.0 != 0 && self.0 & Self::LEAF == 0).then_some(self.0)
    }

    /// The index of the leaf, if the cell is one and not empty.
    pub fn as_leaf(self) -> Option<u32> {
        (self.0 & Self::LEAF != 0).then_some(self.0 & !Self::LEAF)
    }
}

/// Where a leaf lies in the tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeafCell {
    /// The leaf's index.
    pub leaf: u32,
    /// Its lowest corner, in finest cells: the cube is `2^depth` of them wide.
    pub corner: UVec3,
    /// Its width in finest cells, a power of two.
    pub size: u32,
}
