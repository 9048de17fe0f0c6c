//! Adds up Gaussians in blocks of cells.
//!
//! The cube is divided into regions, which are processed one at a time on each core, and those into blocks. Only one
//! block of sums per core is in memory, at any depth.

use glam::{DVec3, UVec3, Vec3};
use half::f16;

use super::{colors::Directions, gaussian::CellGaussian, optics::Profile};
use crate::{
    exponential::exp_minus,
    field::position_of,
    splat::{harmonics::functions, splats::Splats},
};

/// Levels of cells in a block.
const BLOCK: u32 = 5;
/// Maximum number of levels of regions.
const REGIONS: u32 = 2;
/// Thickness below which a cell is empty.
const THINNEST: f32 = 2e-3;

/// A part of the cube, and its leaves in the order of their codes.
pub struct Region {
    /// Its code among the regions.
    code: u64,
    /// Levels of cells.
    levels: u32,
    /// Code of each leaf among all cells of the cube.
    pub codes: Vec<u64>,
    /// Density times the width of a cell.
    pub thickness: Vec<f32>,
    pub coefficients: Vec<f16>,
}

/// Returns all regions of a cube, in the order of their codes.
pub fn regions(depth: u32) -> Vec<Region> {
    let split = REGIONS.min(depth - BLOCK);
    (0..1u64 << (3 * split))
        .map(|code| Region {
            code,
            levels: depth - split,
            codes: Vec::new(),
            thickness: Vec::new(),
            coefficients: Vec::new(),
        })
        .collect()
}

impl Region {
    /// Adds up the Gaussians. `limits` is the box outside which cells stay empty, in cells.
    pub fn filled(
        mut self,
        splats: &Splats,
        gaussians: &[CellGaussian],
        degree: u32,
        profile: &Profile,
        limits: [DVec3; 2],
    ) -> Self {
        let low = position_of(self.code) << self.levels;
        let near = overlapping(gaussians.iter(), low, 1 << self.levels);
        let directions = Directions::new();
        let mut block = Block::new(degree);
        for code in 0..1u64 << (3 * (self.levels - BLOCK)) {
            let code = self.code << (3 * (self.levels - BLOCK)) | code;
            let low = position_of(code) << BLOCK;
            let near = overlapping(near.iter().copied(), low, 1 << BLOCK);
            if near.is_empty() {
                continue;
            }
            block.clear();
            for gaussian in near {
                block.add(gaussian, low, splats, profile);
            }
            for inside in 0..1u64 << (3 * BLOCK) {
                let place = position_of(inside);
                let sums = block.cell(place);
                let center = (low + place).as_dvec3() + 0.5;
                if sums[0] < THINNEST || center.cmplt(limits[0]).any() || center.cmpgt(limits[1]).any() {
                    continue;
                }
                let colors: Vec<Vec3> = sums[1..].chunks_exact(3).map(|sum| Vec3::from_slice(sum) / sums[0]).collect();
                self.codes.push(code << (3 * BLOCK) | inside);
                self.thickness.push(sums[0]);
                self.coefficients.extend(directions.convert(&colors).into_iter().map(f16::from_f32));
            }
        }
        self
    }
}

/// Returns the Gaussians that reach a cube of cells.
fn overlapping<'a>(gaussians: impl Iterator<Item = &'a CellGaussian>, low: UVec3, size: u32) -> Vec<&'a CellGaussian> {
    gaussians.filter(|gaussian| gaussian.low.cmplt(low + size).all() && gaussian.high.cmpgt(low).all()).collect()
}

/// Sums of a block: for each cell, the thickness and the coefficients times thickness.
struct Block {
    stride: usize,
    sums: Vec<f32>,
}

impl Block {
    fn new(degree: u32) -> Self {
        let stride = 1 + 3 * functions(degree);
        Self { stride, sums: vec![0.0; stride << (3 * BLOCK)] }
    }

    fn clear(&mut self) {
        self.sums.fill(0.0);
    }

    fn cell(&self, place: UVec3) -> &[f32] {
        &self.sums[index(place.x, place.y, place.z) * self.stride..][..self.stride]
    }

    /// Adds the part of a Gaussian that is in the block whose lowest cell is `low`.
    fn add(&mut self, gaussian: &CellGaussian, low: UVec3, splats: &Splats, profile: &Profile) {
        let first = gaussian.low.max(low);
        let last = gaussian.high.min(low + (1 << BLOCK));
        let coefficients = &splats.coefficients(gaussian.index as usize)[..self.stride / 3];
        let form = gaussian.inverse;
        let center = gaussian.center - 0.5;
        let c = form.z_axis.z;
        for x in first.x..last.x {
            let dx = x as f32 - center.x;
            for y in first.y..last.y {
                let dy = y as f32 - center.y;
                // Distances along the column are a z^2 + 2 b z + c; those within reach are an interval.
                let b = form.z_axis.x * dx + form.z_axis.y * dy;
                let a = form.x_axis.x * dx * dx + 2.0 * form.x_axis.y * dx * dy + form.y_axis.y * dy * dy;
                let discriminant = b * b - c * (a - gaussian.reach);
                if discriminant <= 0.0 {
                    continue;
                }
                let (middle, half) = (center.z - b / c, discriminant.sqrt() / c);
                let from = (middle - half).ceil().max(first.z as f32) as u32;
                let to = (middle + half).floor().min(last.z as f32 - 1.0) as i64;
                for z in i64::from(from)..=to {
                    let dz = z as f32 - center.z;
                    let distance = a + dz * (2.0 * b + c * dz);
                    let opacity = gaussian.opacity * exp_minus(0.5 * distance.max(0.0));
                    let thickness = gaussian.scale * profile.density(opacity);
                    let at = index(x - low.x, y - low.y, z as u32 - low.z) * self.stride;
                    let sums = &mut self.sums[at..at + self.stride];
                    sums[0] += thickness;
                    for (sums, coefficient) in sums[1..].chunks_exact_mut(3).zip(coefficients) {
                        (0..3).for_each(|channel| sums[channel] += thickness * coefficient[channel]);
                    }
                }
            }
        }
    }
}

/// The index of a cell in a block.
fn index(x: u32, y: u32, z: u32) -> usize {
    ((x << BLOCK | y) << BLOCK | z) as usize
}
