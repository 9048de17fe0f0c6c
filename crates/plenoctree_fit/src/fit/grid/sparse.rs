//! Sparse grids of voxels.

use glam::{DVec3, IVec3, UVec3, Vec4};

/// Width of a brick, in voxels.
pub(super) const BRICK: u32 = 4;
/// Marks an entry of the table without a brick. The other bits are the distance to the nearest brick, in bricks.
pub(super) const FREE: u32 = 1 << 31;
/// Stands for a missing neighbor.
pub const NO_VOXEL: u32 = u32::MAX;

/// A cube in the field's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cube {
    /// Lowest corner.
    pub low: DVec3,
    /// Width, in world units.
    pub size: f64,
}

/// The place of a voxel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Voxel {
    /// Lowest corner, in cells.
    pub corner: UVec3,
    /// Width, in cells: 1, 2 or 4. Corners are multiples of it.
    pub size: u32,
}

impl Cube {
    /// Returns the middle.
    pub fn middle(self) -> DVec3 {
        self.low + 0.5 * self.size
    }

    /// Returns the distance of a point from the middle, above 0.
    pub fn distance(self, point: DVec3) -> f64 {
        point.distance(self.middle()).max(1e-9)
    }
}

impl Voxel {
    /// The largest size.
    pub const LARGEST: u32 = BRICK;

    /// Returns the voxel that is a single cell.
    pub fn cell(corner: UVec3) -> Self {
        Self { corner, size: 1 }
    }

    /// Returns the voxels of at most the largest size that make up a cube of any size.
    pub fn parts(self) -> impl Iterator<Item = Self> {
        let size = self.size.min(Self::LARGEST);
        let side = self.size / size;
        (0..side.pow(3)).map(move |part| Self {
            corner: self.corner + size * UVec3::new(part / (side * side), part / side % side, part % side),
            size,
        })
    }

    /// Returns the eight voxels, half as wide, that it can be split in.
    pub fn children(self) -> impl Iterator<Item = Self> {
        let size = self.size / 2;
        (0..8).map(move |child| Self {
            corner: self.corner + size * UVec3::new(child >> 2, child >> 1 & 1, child & 1),
            size,
        })
    }
}

/// The voxels of 4 x 4 x 4 cells. Bit `16x + 4y + z` stands for a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Cells {
    /// The cells that are part of a voxel.
    pub(super) filled: u64,
    /// The lowest cell of each voxel.
    pub(super) voxels: u64,
}

impl Cells {
    /// Adds a voxel whose lowest corner is `place`.
    pub(super) fn insert(&mut self, place: UVec3, size: u32) {
        let cells = cells_of(place, size);
        self.filled |= cells;
        self.voxels = self.voxels & !cells | 1 << bit_of(place);
    }

    /// Returns the lowest cell of the voxel that a filled cell is part of.
    #[inline]
    pub(super) fn lowest(&self, bit: u32) -> u32 {
        // The lowest cell of the 2 x 2 x 2 that the cell is in.
        let octant = bit & !0b010101;
        if self.voxels >> bit & 1 == 1 {
            bit
        } else if self.voxels >> octant & 1 == 1 {
            octant
        } else {
            0
        }
    }

    /// Returns the width of the voxel whose lowest cell this is.
    pub(super) fn size(&self, lowest: u32) -> u32 {
        let place = place_of(lowest);
        let is_one = |size: &u32| {
            let cells = cells_of(place, *size);
            place % *size == UVec3::ZERO && self.filled & cells == cells && self.voxels & cells == 1 << lowest
        };
        [BRICK, 2].into_iter().find(is_one).unwrap_or(1)
    }

    /// Returns the voxels of the brick at `corner`, in the order of the bits of their lowest cells.
    pub(super) fn places(self, corner: UVec3) -> impl Iterator<Item = Voxel> {
        let lowest = (0..64).filter(move |bit| self.voxels >> bit & 1 == 1);
        lowest.map(move |bit| Voxel { corner: corner + place_of(bit), size: self.size(bit) })
    }
}

/// 4 x 4 x 4 cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Brick {
    pub(super) cells: Cells,
    /// Index of the first voxel.
    pub(super) first: u32,
    /// Lowest corner, in bricks.
    pub(super) corner: [u16; 3],
}

impl Brick {
    /// Returns the voxel that a filled cell is part of.
    #[inline]
    pub(super) fn voxel(&self, bit: u32) -> u32 {
        self.first + below(self.cells.voxels, self.cells.lowest(bit))
    }
}

/// A sparse grid of voxels, and the optimizer's state of each.
///
/// The coefficients of a voxel are `functions` vectors: vector `b` holds the coefficients of the basis function `Y_b`
/// for red, green and blue. The fourth element of the first vector is the voxel's thickness: its density times the
/// width of a cell, whatever its own width. The fourth elements of the others are not used.
#[derive(Clone, Debug)]
pub struct Grid {
    pub(super) cube: Cube,
    /// Cells per side.
    pub(super) resolution: u32,
    /// Basis functions per voxel.
    pub(super) functions: usize,
    /// The brick at each place, or [`FREE`].
    pub(super) table: Vec<u32>,
    pub(super) bricks: Vec<Brick>,
    /// Coefficients and thickness.
    pub values: Vec<Vec4>,
    /// Mean square of the gradient: of the coefficients by channel, and of the thickness.
    pub squares: Vec<Vec4>,
    /// Updates so far, at most 65535.
    pub updates: Vec<u16>,
    /// Copy of the thickness, for marching.
    pub thickness: Vec<f32>,
    /// The six neighbors of each voxel, or [`NO_VOXEL`].
    pub neighbors: Vec<[u32; 6]>,
}

impl Grid {
    pub fn cube(&self) -> Cube {
        self.cube
    }

    pub fn resolution(&self) -> u32 {
        self.resolution
    }

    pub fn functions(&self) -> usize {
        self.functions
    }

    /// Returns the number of voxels.
    pub fn len(&self) -> usize {
        self.thickness.len()
    }

    /// Returns the width of a cell, in world units.
    pub fn cell_size(&self) -> f64 {
        self.cube.size / f64::from(self.resolution)
    }

    /// Returns the voxel that the cell at `position` is part of, if there is one.
    pub fn voxel(&self, position: IVec3) -> Option<u32> {
        let side = self.resolution as i32;
        if position.cmplt(IVec3::ZERO).any() || position.cmpge(IVec3::splat(side)).any() {
            return None;
        }
        let entry = self.table[self.table_index(position.as_uvec3() / BRICK)];
        let brick = self.bricks.get(entry as usize)?;
        let bit = bit_of(position.as_uvec3() % BRICK);
        (brick.cells.filled >> bit & 1 == 1).then(|| brick.voxel(bit))
    }

    /// Returns the places of all voxels, in the order of their numbers.
    pub fn voxels(&self) -> impl Iterator<Item = Voxel> + '_ {
        self.bricks.iter().flat_map(|brick| {
            let corner = UVec3::from(brick.corner.map(u32::from)) * BRICK;
            brick.cells.places(corner)
        })
    }

    /// Returns the center of a voxel, in the field's frame.
    pub fn center(&self, voxel: Voxel) -> DVec3 {
        self.cube.low + (voxel.corner.as_dvec3() + 0.5 * f64::from(voxel.size)) * self.cell_size()
    }

    /// Returns the sum of the squares of a voxel's gradients so far, about: how much pictures disagree with its values
    /// and with each other about them.
    pub fn power(&self, voxel: usize) -> f32 {
        let square = self.squares[voxel];
        f32::from(self.updates[voxel]) * (self.functions as f32 * square.truncate().element_sum() + square.w)
    }

    /// Copies the thickness of all voxels from their values.
    pub fn copy_thickness(&mut self) {
        let values = self.values.iter().step_by(self.functions);
        self.thickness.iter_mut().zip(values).for_each(|(thickness, value)| *thickness = value.w);
    }

    pub(super) fn bricks_per_side(&self) -> u32 {
        self.resolution / BRICK
    }

    pub(super) fn table_index(&self, brick: UVec3) -> usize {
        let side = self.bricks_per_side();
        ((brick.x * side + brick.y) * side + brick.z) as usize
    }
}

/// Returns the bit of the cell at `place` in its brick.
pub(super) fn bit_of(place: UVec3) -> u32 {
    16 * place.x + 4 * place.y + place.z
}

/// The inverse of [`bit_of`].
pub(super) fn place_of(bit: u32) -> UVec3 {
    UVec3::new(bit >> 4, bit >> 2 & 3, bit & 3)
}

/// Returns the bits of the cells of a voxel in its brick.
fn cells_of(place: UVec3, size: u32) -> u64 {
    let cells: u64 = match size {
        1 => 1,
        2 => 0x0033_0033,
        _ => u64::MAX,
    };
    cells << bit_of(place)
}

/// Returns how many voxels of a brick come before the one at `bit`.
#[inline]
pub(super) fn below(mask: u64, bit: u32) -> u32 {
    (mask & ((1 << bit) - 1)).count_ones()
}
