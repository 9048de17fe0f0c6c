//! Finds the voxels that the cameras see.

use std::sync::Mutex;

use glam::DVec2;
use rayon::prelude::*;

use crate::{
    exponential::exp_minus,
    fit::{
        grid::{Grid, Voxel, VoxelSet},
        input::ViewCamera,
    },
};

/// Transmittance below which nothing is seen.
const STOP: f32 = 1e-5;
/// Number of cameras from which their rays are farther apart, so that all of them have about as many as this number.
const MANY: f64 = 400.0;

/// The conditions for keeping a voxel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Limits of a voxel's largest weight over all rays, from the strictest. A limit is skipped if rays would lose more
    /// than `loss` by it, as in fog, where all voxels have little weight. The last one always applies.
    pub weights: [f32; 4],
    /// The opacity that rays may lose: the root mean square.
    pub loss: f64,
    /// The same for thick voxels, such as those behind a surface.
    pub thick_weight: f32,
    /// The thickness from which a voxel counts as thick.
    pub thick: f32,
    /// Distance of the rays, in cells.
    pub spacing: f64,
    /// The most voxels to keep: those with the largest weights.
    pub most: usize,
}

impl Default for Limits {
    fn default() -> Self {
        let weights = [0.03, 0.01, 3e-3, 1e-3];
        Self { weights, loss: 0.04, thick_weight: 2e-5, thick: 0.05, spacing: 1.0, most: usize::MAX }
    }
}

impl Limits {
    /// For fields that are already right: removes only what is hardly visible.
    pub const FAINTEST: Self =
        Self { weights: [1e-3; 4], loss: 0.04, thick_weight: 2e-5, thick: 0.05, spacing: 1.0, most: usize::MAX };

    /// Returns whether a voxel is worth keeping.
    fn keep(&self, limit: f32, weight: f32, thickness: f32) -> bool {
        weight > limit || weight > self.thick_weight && thickness > self.thick
    }
}

/// Returns the largest weight that each voxel has on any ray of the cameras. Rays are about `spacing` cells apart, or
/// more if there are many cameras.
pub fn largest_weights(grid: &Grid, cameras: &[&ViewCamera], spacing: f64) -> Vec<f32> {
    let pool: Mutex<Vec<Vec<f32>>> = Mutex::default();
    let sparseness = sparseness(cameras.len());
    cameras.par_iter().for_each(|camera| {
        let taken = pool.lock().ok().and_then(|mut pool| pool.pop());
        let mut weights = taken.unwrap_or_else(|| vec![0.0; grid.len()]);
        for pixel in pixels(grid, camera, spacing, sparseness) {
            march(grid, camera, pixel, |voxel, seen| {
                let weight = &mut weights[voxel as usize];
                *weight = weight.max(seen);
            });
        }
        if let Ok(mut pool) = pool.lock() {
            pool.push(weights);
        }
    });
    let mut all = vec![0.0f32; grid.len()];
    for weights in pool.into_inner().unwrap_or_default() {
        all.iter_mut().zip(weights).for_each(|(all, weight)| *all = all.max(weight));
    }
    all
}

/// Returns how many times farther apart the rays of this number of cameras are.
fn sparseness(cameras: usize) -> f64 {
    (cameras as f64 / MANY).max(1.0).sqrt()
}

/// Returns the points of the picture whose rays are about `spacing` cells apart in the middle of the grid, or
/// `sparseness` times that.
fn pixels(grid: &Grid, camera: &ViewCamera, spacing: f64, sparseness: f64) -> impl Iterator<Item = DVec2> {
    let middle = grid.cube().low + 0.5 * grid.cube().size;
    let pixels = spacing * grid.cell_size() * camera.lens.focal.x / camera.position.distance(middle).max(1e-9);
    let step = (pixels.clamp(0.1, 4.0) * sparseness).min(camera.width.min(camera.height).into());
    let count = move |size: u32| (f64::from(size) / step) as u32;
    let every = move |size: u32| (0..count(size)).map(move |index| (f64::from(index) + 0.5) * step);
    let width = camera.width;
    every(camera.height).flat_map(move |y| every(width).map(move |x| DVec2::new(x, y)))
}

/// Calls `visit` with the voxels that a ray sees, and with their weights.
fn march(grid: &Grid, camera: &ViewCamera, pixel: DVec2, mut visit: impl FnMut(u32, f32)) {
    let mut transmittance = 1.0f32;
    grid.march(&grid.ray(camera.position, camera.direction(pixel)), |voxel, length| {
        let through = exp_minus(grid.thickness[voxel as usize] * length);
        visit(voxel, transmittance * (1.0 - through));
        transmittance *= through;
        transmittance >= STOP
    });
}

/// Returns the strictest limit with an acceptable loss.
fn limit(grid: &Grid, cameras: &[&ViewCamera], weights: &[f32], limits: &Limits) -> f32 {
    let sparseness = sparseness(cameras.len());
    let of_camera = |camera: &&ViewCamera| {
        let (mut squared, mut count) = ([0.0; 4], 0.0);
        for pixel in pixels(grid, camera, 4.0 * limits.spacing, sparseness) {
            let mut lost = [0.0f32; 4];
            let mut any = false;
            march(grid, camera, pixel, |voxel, seen| {
                any = true;
                let (weight, thickness) = (weights[voxel as usize], grid.thickness[voxel as usize]);
                for (lost, limit) in lost.iter_mut().zip(limits.weights) {
                    *lost += if limits.keep(limit, weight, thickness) { 0.0 } else { seen };
                }
            });
            if any {
                count += 1.0;
                squared.iter_mut().zip(lost).for_each(|(sum, lost)| *sum += f64::from(lost * lost));
            }
        }
        (squared, count)
    };
    let sums: Vec<([f64; 4], f64)> = cameras.par_iter().map(of_camera).collect();
    let count: f64 = sums.iter().map(|(_, count)| count).sum();
    let loss = |index: usize| (sums.iter().map(|(squared, _)| squared[index]).sum::<f64>() / count.max(1.0)).sqrt();
    let last = limits.weights.len() - 1;
    limits.weights[(0..last).find(|&index| loss(index) <= limits.loss).unwrap_or(last)]
}

/// Returns the voxels that are worth keeping.
pub fn visible(grid: &Grid, cameras: &[&ViewCamera], limits: Limits) -> VoxelSet {
    let weights = largest_weights(grid, cameras, limits.spacing);
    let limit = limit(grid, cameras, &weights, &limits);
    let mut kept: Vec<(Voxel, f32)> = (grid.voxels().zip(weights).zip(&grid.thickness))
        .filter(|((_, weight), thickness)| limits.keep(limit, *weight, **thickness))
        .map(|(kept, _)| kept)
        .collect();
    kept.sort_by(|(_, a), (_, b)| b.total_cmp(a));
    VoxelSet::of(grid.resolution(), kept.into_iter().take(limits.most).map(|(voxel, _)| voxel))
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec3, UVec3, Vec4};

    use super::*;
    use crate::fit::{
        grid::Cube,
        input::{Distortion, Lens},
    };

    /// A camera that sees all of a cube around the origin.
    fn camera() -> ViewCamera {
        let lens = Lens { focal: DVec2::splat(40.0), center: DVec2::splat(32.0), distortion: Distortion::None };
        ViewCamera::undistorted(64, 64, lens, DMat3::IDENTITY, DVec3::new(0.0, 0.0, 4.0))
    }

    /// A grid of 64 voxels per side. `thickness` is that of the voxel at a position, or 0 if there is none.
    fn grid(thickness: impl Fn(UVec3) -> f32) -> Grid {
        let positions = (0..64u32.pow(3)).map(|code| UVec3::new(code / 4096, code / 64 % 64, code % 64));
        let filled = positions.filter(|position| thickness(*position) > 0.0);
        let set = VoxelSet::of(64, filled.map(Voxel::cell));
        let mut grid = Grid::new(Cube { low: DVec3::splat(-1.0), size: 2.0 }, 1, &set);
        let values: Vec<f32> = grid.voxels().map(|voxel| thickness(voxel.corner)).collect();
        grid.values.iter_mut().zip(values).for_each(|(value, thickness)| *value = Vec4::new(0.0, 0.0, 0.0, thickness));
        grid.copy_thickness();
        grid
    }

    /// Haze in front of a wall is removed. The same haze is kept where nothing else is visible, and so is a dense
    /// cloud.
    #[test]
    fn haze_goes_and_clouds_stay() {
        let count = |thickness: &dyn Fn(UVec3) -> f32| {
            let grid = grid(thickness);
            let kept = visible(&grid, &[&camera()], Limits { spacing: 0.5, ..Limits::default() });
            (kept.voxels().count(), grid.voxels().filter(|voxel| voxel.corner.z > 10).count())
        };
        let wall = |at: UVec3| if at.z == 10 { 40.0 } else { 0.0 };
        let (kept, faint) = count(&|at| wall(at) + if at.z > 10 { 5e-4 } else { 0.0 });
        assert!(kept > 3000 && faint > 100_000 && kept < 4200, "{kept} of {faint}");
        let (kept, all) = count(&|at| if at.z > 10 { 0.01 } else { 0.0 });
        assert!(kept as f64 > 0.9 * all as f64, "{kept} of {all}");
    }

    /// If there may be only a few voxels, the most visible ones are kept: those that face the camera.
    #[test]
    fn the_most_visible_are_kept() {
        let grid = grid(|at| if at.z >= 40 { 0.5 } else { 0.0 });
        let kept = visible(&grid, &[&camera()], Limits { spacing: 0.5, most: 1000, ..Limits::default() });
        assert_eq!(kept.voxels().count(), 1000);
        assert!(kept.voxels().all(|voxel| voxel.corner.z >= 58));
    }

    /// Thousands of cameras cast about as many rays as hundreds, and see about the same voxels.
    #[test]
    fn many_cameras_take_no_longer() {
        let shell = |at: UVec3| (at.as_dvec3() + 0.5 - 32.0).length();
        let grid = grid(|at| if (20.0..30.0).contains(&shell(at)) { 40.0 } else { 0.0 });
        let around = |index: usize, count: usize| {
            let (turn, up) = (2.4 * index as f64, 1.0 - (2 * index + 1) as f64 / count as f64);
            let rotation = DMat3::from_rotation_y(turn) * DMat3::from_rotation_x(-up.asin());
            let lens = Lens { focal: DVec2::splat(80.0), center: DVec2::splat(64.0), distortion: Distortion::None };
            ViewCamera::undistorted(128, 128, lens, rotation, 4.0 * rotation.z_axis)
        };
        let seen = |count: usize| {
            let cameras: Vec<_> = (0..count).map(|index| around(index, count)).collect();
            let rays: usize = cameras.iter().map(|camera| pixels(&grid, camera, 1.0, sparseness(count)).count()).sum();
            let set = visible(&grid, &cameras.iter().collect::<Vec<_>>(), Limits::default());
            (rays, set.voxels().collect::<Vec<_>>())
        };
        let ((few_rays, few), (many_rays, many)) = (seen(400), seen(6400));
        assert!(many_rays < few_rays * 5 / 4, "{many_rays} rays instead of {few_rays}");
        let both = few.iter().filter(|voxel| many.contains(voxel)).count();
        assert!(few.len() > 5000, "{}", few.len());
        assert!(both * 100 > few.len() * 95, "{both} of {}", few.len());
    }
}
