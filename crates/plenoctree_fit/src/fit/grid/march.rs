//! Marches rays through the grid, voxel by voxel.

use glam::{DVec3, IVec3, Vec3};

use super::sparse::{BRICK, FREE, Grid, NO_VOXEL};

/// A ray in cells: the grid spans 0 to its resolution.
#[derive(Clone, Copy, Debug)]
pub struct GridRay {
    origin: Vec3,
    direction: Vec3,
}

/// The part of a ray that is in a voxel, in cells.
#[derive(Clone, Copy, Debug)]
pub struct Crossing {
    pub voxel: u32,
    /// Distance from the ray's origin.
    pub start: f32,
    pub length: f32,
}

impl Grid {
    /// Converts a ray in the field's frame. `direction` is a unit vector.
    pub fn ray(&self, origin: DVec3, direction: DVec3) -> GridRay {
        let scale = 1.0 / self.cell_size();
        GridRay { origin: ((origin - self.cube.low) * scale).as_vec3(), direction: direction.as_vec3() }
    }

    /// Calls `visit` with each voxel that the ray crosses, in order. Stops when `visit` returns `false`.
    #[inline]
    pub fn march(&self, ray: &GridRay, mut visit: impl FnMut(Crossing) -> bool) {
        const NOTHING: Crossing = Crossing { voxel: NO_VOXEL, start: 0.0, length: 0.0 };
        // What the ray has crossed so far of the voxel that it is in: a large voxel has several cells on the ray.
        let mut crossing = NOTHING;
        self.march_cells(ray, |next| {
            if next.voxel == crossing.voxel {
                crossing.length += next.length;
                return true;
            }
            let goes_on = crossing.voxel == NO_VOXEL || visit(crossing);
            crossing = if goes_on { next } else { NOTHING };
            goes_on
        });
        if crossing.voxel != NO_VOXEL {
            visit(crossing);
        }
    }

    /// Calls `visit` with each cell of a voxel that the ray crosses, in order. Stops when `visit` returns `false`.
    #[inline]
    fn march_cells(&self, ray: &GridRay, mut visit: impl FnMut(Crossing) -> bool) {
        const SMALL: f32 = 1e-7;
        let origin = ray.origin;
        let direction = Vec3::select(ray.direction.abs().cmplt(Vec3::splat(SMALL)), Vec3::splat(SMALL), ray.direction);
        let inverse = direction.recip();
        let end = Vec3::splat(self.resolution as f32);
        let (near, far) = (-origin * inverse, (end - origin) * inverse);
        let mut t = near.min(far).max_element().max(0.0);
        let exit = near.max(far).min_element();
        if t >= exit || t.is_nan() {
            return;
        }

        let last = IVec3::splat(self.resolution as i32 - 1);
        let forward = direction.cmpgt(Vec3::ZERO);
        // 1 where the ray leaves a cell through its upper face.
        let upper = IVec3::select(forward, IVec3::ONE, IVec3::ZERO);
        let step = IVec3::select(forward, IVec3::ONE, IVec3::NEG_ONE);
        let across = inverse.abs();
        let width = BRICK as i32;
        let side = self.bricks_per_side() as i32;
        let mut cell = (origin + t * direction).as_ivec3().clamp(IVec3::ZERO, last);
        loop {
            let corner = cell / width;
            let entry = self.table[((corner.x * side + corner.y) * side + corner.z) as usize];
            if entry & FREE != 0 {
                // No brick is nearer than this, so that the ray can leave a cube of bricks at once.
                let reach = (entry & !FREE) as i32 - 1;
                let (low, high) = ((corner - reach) * width, (corner + reach + 1) * width);
                let plane = IVec3::select(forward, high, low);
                let through = (plane.as_vec3() - origin) * inverse;
                let axis = through.min_position();
                t = t.max(through[axis]);
                if t >= exit {
                    return;
                }
                cell = (origin + t * direction).as_ivec3().clamp(low, high - 1);
                cell[axis] = if forward.test(axis) { high[axis] } else { low[axis] - 1 };
                if cell[axis] < 0 || cell[axis] > last[axis] {
                    return;
                }
                cell = cell.clamp(IVec3::ZERO, last);
                continue;
            }

            let brick = &self.bricks[entry as usize];
            let base = corner * width;
            let next = ((cell + upper).as_vec3() - origin) * inverse;
            let (mut next_x, mut next_y, mut next_z) = (next.x, next.y, next.z);
            let mut place = cell - base;
            loop {
                let leave = next_x.min(next_y).min(next_z);
                let bit = (16 * place.x + 4 * place.y + place.z) as u32;
                if brick.cells.filled >> bit & 1 == 1 {
                    let length = leave - t;
                    if length > 0.0 && !visit(Crossing { voxel: brick.voxel(bit), start: t, length }) {
                        return;
                    }
                }
                t = t.max(leave);
                // Without branches, which would be mispredicted every other time.
                let through_x = next_x <= next_y && next_x <= next_z;
                let through_y = !through_x && next_y <= next_z;
                let through_z = !through_x && !through_y;
                next_x += if through_x { across.x } else { 0.0 };
                next_y += if through_y { across.y } else { 0.0 };
                next_z += if through_z { across.z } else { 0.0 };
                place.x += if through_x { step.x } else { 0 };
                place.y += if through_y { step.y } else { 0 };
                place.z += if through_z { step.z } else { 0 };
                if (place.x | place.y | place.z) & !3 != 0 {
                    break;
                }
            }
            cell = base + place;
            if cell.cmplt(IVec3::ZERO).any() || cell.cmpgt(last).any() {
                return;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::UVec3;
    use proptest::prelude::*;

    use super::*;
    use crate::fit::grid::{Cube, Voxel, build::VoxelSet};

    /// The voxels and path lengths that a plain search finds: the ray against the box of every voxel, in float64.
    fn crossed(grid: &Grid, origin: DVec3, direction: DVec3) -> Vec<(f64, u32, f64)> {
        let mut found: Vec<(f64, u32, f64)> = (grid.voxels().zip(0..))
            .filter_map(|(Voxel { corner, size }, voxel)| {
                let low = grid.cube().low + corner.as_dvec3() * grid.cell_size();
                let high = low + f64::from(size) * grid.cell_size();
                let (a, b) = ((low - origin) / direction, (high - origin) / direction);
                let (start, end) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
                (end > start).then_some((start, voxel, (end - start) / grid.cell_size()))
            })
            .collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found
    }

    /// Inserts those of the voxels, each given by a cell of it and the logarithm of its size, that overlap none before.
    fn insert_some(set: &mut VoxelSet, voxels: &[(u32, u32, u32, u32)]) {
        for &(x, y, z, level) in voxels {
            let size = 1 << level;
            let corner = UVec3::new(x, y, z) / size * size;
            let mut cells =
                (0..size.pow(3)).map(|at| corner + UVec3::new(at / size / size, at / size % size, at % size));
            if cells.all(|cell| !set.contains(cell)) {
                set.insert(Voxel { corner, size });
            }
        }
    }

    fn coordinate(low: f64, high: f64) -> impl Strategy<Value = DVec3> {
        (low..high, low..high, low..high).prop_map(|(x, y, z)| DVec3::new(x, y, z))
    }

    proptest! {
        /// Bricks, jumps over free space and steps from face to face find every voxel, whatever its size, that the ray
        /// crosses by more than rounding, in order, with its distance and length.
        #[test]
        fn marches_cross_every_voxel(
            voxels in prop::collection::vec((0u32..32, 0u32..32, 0u32..32, 0u32..3), 1..200),
            origin in coordinate(-4.0, 4.0),
            target in coordinate(-0.8, 0.8),
        ) {
            let mut set = VoxelSet::new(32);
            insert_some(&mut set, &voxels);
            let grid = Grid::new(Cube { low: DVec3::NEG_ONE, size: 2.0 }, 1, &set);
            let direction = (target - origin).normalize();
            let expected: Vec<_> = crossed(&grid, origin, direction).into_iter().filter(|hit| hit.2 > 1e-3).collect();
            let mut found = Vec::new();
            grid.march(&grid.ray(origin, direction), |crossing| {
                found.push(crossing);
                true
            });
            found.retain(|crossing| crossing.length > 1e-3);
            prop_assert_eq!(found.len(), expected.len());
            for (found, expected) in found.iter().zip(&expected) {
                prop_assert_eq!(found.voxel, expected.1);
                prop_assert!((f64::from(found.start) * grid.cell_size() - expected.0).abs() < 1e-3);
                prop_assert!((f64::from(found.length) - expected.2).abs() < 1e-3);
            }
        }
    }
}
