//! The mean of a model over the last batches of a stage.
//!
//! Steps follow the gradient of a few rays and go back and forth around the optimum. The mean is closer to it, so that
//! rates need not become so small that the field hardly changes.

use glam::Vec4;
use rayon::prelude::*;

use crate::fit::grid::Grid;

/// Interval, in batches, at which values are added, because adding all of them takes time.
const EVERY: u32 = 6;
/// Number of values that a thread adds up at a time.
const CHUNK: usize = 8192;

/// The mean of the values of a grid's voxels.
#[derive(Default)]
pub struct Average {
    sums: Vec<Vec4>,
    count: u32,
    batches: u32,
}

impl Average {
    /// Adds the values after a batch. `grid` has the same voxels as before.
    pub fn add(&mut self, grid: &Grid) {
        self.batches += 1;
        if self.batches % EVERY != 1 {
            return;
        }
        self.sums.resize(grid.values.len(), Vec4::ZERO);
        self.count += 1;
        self.sums.par_chunks_mut(CHUNK).zip(grid.values.par_chunks(CHUNK)).for_each(|(sums, values)| {
            sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += *value);
        });
    }

    /// Gives the voxels their means, if there are any.
    pub fn apply(self, grid: &mut Grid) {
        if self.count > 0 && self.sums.len() == grid.values.len() {
            let share = 1.0 / self.count as f32;
            grid.values.iter_mut().zip(self.sums).for_each(|(value, sum)| *value = share * sum);
            grid.copy_thickness();
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, UVec3};

    use super::*;
    use crate::fit::grid::{Cube, Voxel, VoxelSet};

    /// Values that go back and forth end in the middle, and so does the thickness that rays are marched with; without
    /// batches, nothing changes.
    #[test]
    fn values_end_at_their_mean() {
        let set = VoxelSet::of(8, [UVec3::ONE, UVec3::splat(5)].map(Voxel::cell));
        let mut grid = Grid::new(Cube { low: DVec3::ZERO, size: 1.0 }, 4, &set);
        grid.values.fill(Vec4::splat(3.0));
        Average::default().apply(&mut grid);
        assert_eq!(grid.values, vec![Vec4::splat(3.0); 8]);
        let mut average = Average::default();
        for batch in 0..4 * EVERY {
            let step = if (batch / EVERY).is_multiple_of(2) { 0.25 } else { -0.25 };
            grid.values.iter_mut().zip(0u8..).for_each(|(value, index)| *value = Vec4::splat(f32::from(index) + step));
            average.add(&grid);
        }
        average.apply(&mut grid);
        let expected: Vec<Vec4> = (0u8..8).map(|index| Vec4::splat(index.into())).collect();
        assert_eq!(grid.values, expected);
        assert_eq!(grid.thickness, [0.0, 4.0]);
    }
}
