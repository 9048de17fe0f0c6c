//! Which voxels the cameras see.

use std::sync::Mutex;

use glam::DVec2;
use rayon::prelude::*;

use crate::{
    exponential::exp_minus,
    fit::{
        grid::{Grid, VoxelSet},
        input::ViewCamera,
    },
};

/// Transmittance below which nothing is seen.
const STOP: f32 = 1e-5;

/// What makes a voxel worth keeping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Largest weight over all rays.
    pub weight: f32,
    /// The same for voxels that are thick, such as those behind a surface.
    pub thick_weight: f32,
    /// What is thick.
    pub thick: f32,
    /// Distance of the rays, in voxels.
    pub spacing: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { weight: 1e-3, thick_weight: 2e-5, thick: 0.05, spacing: 1.0 }
    }
}

/// Returns the largest weight that each voxel has on any ray of the cameras. Rays are about `spacing` voxels apart.
pub fn largest_weights(grid: &Grid, cameras: &[&ViewCamera], spacing: f64) -> Vec<f32> {
    let middle = grid.cube().low + 0.5 * grid.cube().size;
    let pool: Mutex<Vec<Vec<f32>>> = Mutex::default();
    cameras.par_iter().for_each(|camera| {
        let taken = pool.lock().ok().and_then(|mut pool| pool.pop());
        let mut weights = taken.unwrap_or_else(|| vec![0.0; grid.len()]);
        let pixels = spacing * grid.voxel_size() * camera.lens.focal.x / camera.position.distance(middle).max(1e-9);
        let step = pixels.clamp(0.1, 4.0);
        let count = |size: u32| (f64::from(size) / step) as u32;
        let every = |size: u32| (0..count(size)).map(move |index| (f64::from(index) + 0.5) * step);
        for (x, y) in every(camera.height).flat_map(|y| every(camera.width).map(move |x| (x, y))) {
            let pixel = DVec2::new(x, y);
            let mut transmittance = 1.0f32;
            grid.march(&grid.ray(camera.position, camera.direction(pixel)), |voxel, length| {
                let through = exp_minus(grid.thickness[voxel as usize] * length);
                let weight = &mut weights[voxel as usize];
                *weight = weight.max(transmittance * (1.0 - through));
                transmittance *= through;
                transmittance >= STOP
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

/// Returns the voxels that are worth keeping.
pub fn visible(grid: &Grid, cameras: &[&ViewCamera], limits: Limits) -> VoxelSet {
    let weights = largest_weights(grid, cameras, limits.spacing);
    let mut set = VoxelSet::new(grid.resolution());
    for ((position, weight), thickness) in grid.positions().zip(weights).zip(&grid.thickness) {
        if weight > limits.weight || weight > limits.thick_weight && *thickness > limits.thick {
            set.insert(position);
        }
    }
    set
}
