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

/// 4 x 4 x 4 voxels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Brick {
    /// The voxels that exist: bit `16x + 4y + z`.
    pub(super) mask: u64,
    /// Index of the first voxel.
    pub(super) first: u32,
    /// Lowest corner, in bricks.
    pub(super) corner: [u16; 3],
}

/// A sparse grid of voxels, and the optimizer's state of each.
///
/// The coefficients of a voxel are `functions` vectors: vector `b` holds the coefficients of the basis function `Y_b`
/// for red, green and blue. The fourth element of the first vector is the voxel's thickness: its density times its
/// width. The fourth elements of the others are not used.
#[derive(Clone, Debug)]
pub struct Grid {
    pub(super) cube: Cube,
    /// Voxels per side.
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

    /// Returns the width of a voxel, in world units.
    pub fn voxel_size(&self) -> f64 {
        self.cube.size / f64::from(self.resolution)
    }

    /// Returns the voxel at `position`, if it exists.
    pub fn voxel(&self, position: IVec3) -> Option<u32> {
        let side = self.resolution as i32;
        if position.cmplt(IVec3::ZERO).any() || position.cmpge(IVec3::splat(side)).any() {
            return None;
        }
        let entry = self.table[self.table_index(position.as_uvec3() / BRICK)];
        let brick = self.bricks.get(entry as usize)?;
        let bit = bit_of(position.as_uvec3() % BRICK);
        (brick.mask >> bit & 1 == 1).then(|| brick.first + below(brick.mask, bit))
    }

    /// Returns the positions of all voxels, in the order of their numbers.
    pub fn positions(&self) -> impl Iterator<Item = UVec3> + '_ {
        self.bricks.iter().flat_map(|brick| {
            let corner = UVec3::from(brick.corner.map(u32::from)) * BRICK;
            (0..64).filter(|bit| brick.mask >> bit & 1 == 1).map(move |bit| corner + place_of(bit))
        })
    }

    /// Returns the center of the voxel at `position`, in the field's frame.
    pub fn center(&self, position: UVec3) -> DVec3 {
        self.cube.low + (position.as_dvec3() + 0.5) * self.voxel_size()
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

/// Returns the bit of the voxel at `place` in its brick.
pub(super) fn bit_of(place: UVec3) -> u32 {
    16 * place.x + 4 * place.y + place.z
}

/// The inverse of [`bit_of`].
pub(super) fn place_of(bit: u32) -> UVec3 {
    UVec3::new(bit >> 4, bit >> 2 & 3, bit & 3)
}

/// Returns how many voxels of a brick come before the one at `bit`.
#[inline]
pub(super) fn below(mask: u64, bit: u32) -> u32 {
    (mask & ((1 << bit) - 1)).count_ones()
}
