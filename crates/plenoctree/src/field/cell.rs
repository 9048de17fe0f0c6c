//! Cells of the octree.

use glam::UVec3;

/// One of a node's eight cells, packed into 32 bits as shaders read it.
///
/// 0 is an empty cell. The high bit marks a leaf. The other bits are an index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub struct Cell(u32);

impl Cell {
    /// A cell without density.
    pub const EMPTY: Self = Self(0);
    const LEAF: u32 = 1 << 31;

    /// Creates a subdivided cell.
    ///
    /// `index` is the index of its child node: at least 1, because the root is no cell's child, and less than 2^31.
    pub fn node(index: u32) -> Self {
        debug_assert!(index > 0 && index < Self::LEAF);
        Self(index)
    }

    /// Creates a leaf. `index` is the index of the leaf, less than 2^31.
    pub fn leaf(index: u32) -> Self {
        debug_assert!(index < Self::LEAF);
        Self(Self::LEAF | index)
    }

    /// Returns the index of the child node, or `None` if the cell is not subdivided.
    pub fn as_node(self) -> Option<u32> {
        (self.0 != 0 && self.0 & Self::LEAF == 0).then_some(self.0)
    }

    /// Returns the index of the leaf, or `None` if the cell is empty or subdivided.
    pub fn as_leaf(self) -> Option<u32> {
        (self.0 & Self::LEAF != 0).then_some(self.0 & !Self::LEAF)
    }
}

/// The position and size of a leaf in the tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeafCell {
    /// Index of the leaf.
    pub leaf: u32,
    /// Lowest corner, in finest cells. The tree's cube is `2^depth` finest cells wide.
    pub corner: UVec3,
    /// Width, in finest cells. A power of two.
    pub size: u32,
}
