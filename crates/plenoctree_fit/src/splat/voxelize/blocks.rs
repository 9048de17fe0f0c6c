//! Adds up Gaussians in blocks of cells.
//!
//! The cube is divided into regions, which are processed one at a time on each core, and those into blocks. Only one
//! block of sums per core is in memory, at any depth.

use glam::{DVec3, USizeVec3, UVec3, Vec3};
use rayon::prelude::*;

use super::{
    gaussian::{CellGaussian, Shown},
    optics::Profile,
    parts::Parts,
};
use crate::{
    cells::BLOCK,
    exponential::{exp, exp_minus},
    finest::position_of,
    splat::splats::Splats,
};

/// The work of a Gaussian in a block apart from its sums, in sums.
const WORK_PER_BLOCK: f64 = 50.0;
/// Maximum number of levels of regions.
const REGIONS: u32 = 2;

/// The Gaussians of a capture among the cells of a cube.
pub struct Lattice<'a> {
    splats: &'a Splats,
    /// Levels of cells.
    depth: u32,
    gaussians: Vec<CellGaussian>,
    profile: Profile,
}

impl<'a> Lattice<'a> {
    /// Prepares the Gaussians for the cube at `corner` whose finest cells, at this depth, have this `width`. They are
    /// blurred by this many cells. `shown` says how they show, if not in the mean: see [`areas`].
    ///
    /// [`areas`]: super::areas::areas
    pub fn new(splats: &'a Splats, corner: DVec3, width: f64, depth: u32, blur: f64, shown: Option<&[Shown]>) -> Self {
        let gaussians = (0..splats.len() as u32)
            .into_par_iter()
            .filter_map(|index| {
                let shown = shown.map(|shown| shown[index as usize]);
                CellGaussian::new(splats, index, corner, width, 1 << depth, blur, shown)
            })
            .collect();
        Self { splats, depth, gaussians, profile: Profile::new() }
    }

    /// Returns about how many sums it takes to add up the Gaussians in all blocks.
    pub fn work(&self) -> f64 {
        let of = |gaussian: &CellGaussian| {
            let blocks = (gaussian.high - 1) / (1 << BLOCK) - gaussian.low / (1 << BLOCK) + 1;
            let blocks = blocks.as_dvec3();
            let cells = (gaussian.high - gaussian.low).as_dvec3();
            let points = match gaussian.level.min(BLOCK) {
                0 => cells,
                // Every block has the points of its boundary, which its neighbors have as well.
                level => cells / f64::from(1u32 << level) + blocks,
            };
            WORK_PER_BLOCK * blocks.element_product() + points.element_product()
        };
        self.gaussians.iter().map(of).sum()
    }

    /// Calls `visit` with the code and the sums of each block that is not empty and of which parts are `wanted`, and
    /// returns the results in the order of the codes, on all cores. The sums have `functions` coefficients per channel.
    /// Those of cells in other parts mean nothing.
    pub fn blocks<T: Send>(
        &self,
        functions: usize,
        wanted: impl Fn(u64) -> Option<Parts> + Sync,
        visit: impl Fn(u64, &Block) -> T + Sync,
    ) -> Vec<T> {
        let mut regions = Vec::new();
        let all = Cube { code: 0, levels: self.depth, gaussians: self.gaussians.iter().collect() };
        let region_levels = self.depth - REGIONS.min(self.depth - BLOCK);
        all.divide(region_levels, &mut |region| regions.push(region));
        let of_region = |region: Cube| {
            let mut block = Block::new(functions);
            let mut results = Vec::new();
            region.divide(BLOCK, &mut |Cube { code, gaussians, .. }| {
                let Some(parts) = wanted(code) else { return };
                let low = position_of(code) << BLOCK;
                block.start(parts);
                gaussians.into_iter().for_each(|gaussian| block.add(gaussian, low, self.splats, &self.profile));
                block.flatten();
                results.push(visit(code, &block));
            });
            results
        };
        regions.into_par_iter().map(of_region).collect::<Vec<_>>().into_iter().flatten().collect()
    }
}

/// A cube of cells, and the Gaussians that reach it.
struct Cube<'a> {
    code: u64,
    /// Levels of cells in it.
    levels: u32,
    gaussians: Vec<&'a CellGaussian>,
}

impl Cube<'_> {
    /// Calls `visit` with the parts of this cube that have so many levels and that Gaussians reach, in the order of
    /// their codes.
    fn divide(self, levels: u32, visit: &mut impl FnMut(Self)) {
        if self.gaussians.is_empty() {
            return;
        }
        if self.levels == levels {
            return visit(self);
        }
        let own = self.levels - 1;
        for code in 8 * self.code..8 * (self.code + 1) {
            let low = position_of(code) << own;
            let high = low + (1 << own);
            let reaches = |gaussian: &&CellGaussian| gaussian.low.cmplt(high).all() && gaussian.high.cmpgt(low).all();
            let gaussians = self.gaussians.iter().copied().filter(reaches).collect();
            Self { code, levels: own, gaussians }.divide(levels, visit);
        }
    }
}

/// Sums of a block. A Gaussian is added to the cells or, if it is many cells wide, to the points of the coarsest
/// lattice in which it is still smooth. Otherwise, as many Gaussians at one place would take as many times the cells
/// there.
pub struct Block {
    /// Where cells are wanted.
    parts: Parts,
    /// The cells, then lattices of points that are 2, 4, 8, 16 and 32 cells apart.
    rasters: [Raster; BLOCK as usize + 1],
}

/// Sums at points that are spread evenly: the thickness, and the coefficients times thickness.
struct Raster {
    /// Distance of the points, in cells.
    distance: f32,
    /// Place of the first point, in cells: the center of a cell, or the corner of the block.
    first: f32,
    /// Points per side.
    side: usize,
    stride: usize,
    sums: Vec<f32>,
    is_empty: bool,
}

impl Block {
    fn new(functions: usize) -> Self {
        let stride = 1 + 3 * functions;
        let raster = |level: u32| {
            let (first, side) = if level == 0 { (0.5, 1 << BLOCK) } else { (0.0, (1 << BLOCK >> level) + 1) };
            let distance = (1u32 << level) as f32;
            Raster { distance, first, side, stride, sums: vec![0.0; stride * side * side * side], is_empty: true }
        };
        Self { parts: Parts::ALL, rasters: std::array::from_fn(|level| raster(level as u32)) }
    }

    /// Clears the sums, for a block of which these parts are wanted.
    fn start(&mut self, parts: Parts) {
        self.parts = parts;
        for raster in self.rasters.iter_mut().filter(|raster| !raster.is_empty) {
            raster.sums.fill(0.0);
            raster.is_empty = true;
        }
    }

    /// Adds the part of a Gaussian that is in the block whose lowest cell is `low`.
    fn add(&mut self, gaussian: &CellGaussian, low: UVec3, splats: &Splats, profile: &Profile) {
        let level = gaussian.level.min(BLOCK) as usize;
        // Points of lattices count in several parts.
        let parts = if level == 0 { &self.parts } else { &Parts::ALL };
        self.rasters[level].add(gaussian, low, splats, profile, parts);
    }

    /// Adds the lattices to the cells.
    fn flatten(&mut self) {
        for level in (1..self.rasters.len()).rev() {
            let (finer, coarser) = self.rasters.split_at_mut(level);
            let parts = if level == 1 { &self.parts } else { &Parts::ALL };
            if !coarser[0].is_empty {
                finer[level - 1].add_interpolated(&coarser[0], parts);
            }
        }
    }

    /// Returns the sums of a cell: its thickness, and its coefficients times thickness.
    pub fn cell(&self, place: UVec3) -> &[f32] {
        self.rasters[0].point(place.as_usizevec3())
    }
}

impl Raster {
    fn point(&self, place: USizeVec3) -> &[f32] {
        &self.sums[((place.x * self.side + place.y) * self.side + place.z) * self.stride..][..self.stride]
    }

    fn add(&mut self, gaussian: &CellGaussian, low: UVec3, splats: &Splats, profile: &Profile, parts: &Parts) {
        let (side, stride) = (self.side, self.stride);
        // From here on, in distances of points.
        let center = (gaussian.center - low.as_vec3() - self.first) / self.distance;
        let form = gaussian.inverse * (self.distance * self.distance);
        let extent = gaussian.extent / self.distance;
        let first = (center - extent).ceil().max(Vec3::ZERO).as_usizevec3();
        let most = (side - 1) as f32;
        let last = (center + extent).floor().min(Vec3::splat(most));
        if last.min_element() < 0.0 {
            return;
        }
        let last = last.as_usizevec3();
        self.is_empty = false;
        // What a thickness of 1 adds.
        let mut added = vec![0.0; stride];
        added[0] = 1.0;
        for (added, coefficient) in added[1..].chunks_exact_mut(3).zip(splats.coefficients(gaussian.index as usize)) {
            added.copy_from_slice(&coefficient.to_array());
        }
        let c = form.z_axis.z;
        // Neighbors in a column have a ratio, which is itself multiplied by this from one to the next.
        let bend = exp_minus(c);
        for x in first.x..=last.x {
            let dx = x as f32 - center.x;
            for y in first.y..=last.y {
                let Some([lowest, highest]) = parts.range(x, y) else { continue };
                let dy = y as f32 - center.y;
                // Distances along the column are a z^2 + 2 b z + c; those within reach are an interval.
                let b = form.z_axis.x * dx + form.z_axis.y * dy;
                let a = form.x_axis.x * dx * dx + 2.0 * form.x_axis.y * dx * dy + form.y_axis.y * dy * dy;
                let discriminant = b * b - c * (a - gaussian.reach);
                if discriminant <= 0.0 {
                    continue;
                }
                let (middle, half) = (center.z - b / c, discriminant.sqrt() / c);
                let from = (middle - half).ceil().max(lowest as f32) as usize;
                let to = (middle + half).floor().min(most.min(highest as f32));
                if to < from as f32 {
                    continue;
                }
                let column = ((x * side + y) * side + from) * stride;
                let dz = from as f32 - center.z;
                let distance = a + dz * (2.0 * b + c * dz);
                let mut opacity = gaussian.opacity * exp_minus(0.5 * distance.max(0.0));
                let mut ratio = exp(-b - c * (dz + 0.5));
                for sums in self.sums[column..].chunks_exact_mut(stride).take(to as usize + 1 - from) {
                    add_times(sums, &added, gaussian.scale * profile.density(opacity));
                    opacity *= ratio;
                    ratio *= bend;
                }
            }
        }
    }

    /// Adds the sums of a lattice with half as many points, interpolated linearly, where these parts are.
    fn add_interpolated(&mut self, coarser: &Self, parts: &Parts) {
        self.is_empty = false;
        // The points on either side of each of ours, and the weight of the second.
        let places: Vec<(usize, f32)> = (0..self.side)
            .map(|index| {
                let place = (index as f32 * self.distance + self.first) / coarser.distance;
                let before = (place as usize).min(coarser.side - 2);
                (before, place - before as f32)
            })
            .collect();
        // One axis after another: a plane of the lattice, a row of that plane, and the points of that row.
        let row_length = coarser.side * self.stride;
        let mut plane = vec![0.0; coarser.side * row_length];
        let mut row = vec![0.0; row_length];
        let own_row = self.side * self.stride;
        for (x, sums) in self.sums.chunks_exact_mut(self.side * own_row).enumerate() {
            plane.fill(0.0);
            add_between(&mut plane, &coarser.sums, places[x]);
            for (y, sums) in sums.chunks_exact_mut(own_row).enumerate() {
                let Some([lowest, highest]) = parts.range(x, y) else { continue };
                row.fill(0.0);
                add_between(&mut row, &plane, places[y]);
                let points = sums.chunks_exact_mut(self.stride).zip(&places);
                for (sums, z) in points.take(highest + 1).skip(lowest) {
                    add_between(sums, &row, *z);
                }
            }
        }
    }
}

/// Adds a multiple of a list to another one.
fn add_times(sums: &mut [f32], added: &[f32], factor: f32) {
    let ((sums, rest), (added, others)) = (sums.as_chunks_mut::<4>(), added.as_chunks::<4>());
    for (sums, added) in sums.iter_mut().zip(added) {
        (0..4).for_each(|lane| sums[lane] += factor * added[lane]);
    }
    rest.iter_mut().zip(others).for_each(|(sum, added)| *sum += factor * added);
}

/// Adds the interpolation of two neighbors in a list of elements that are each as long as `sums`, given the index of
/// the first one and the weight of the second.
fn add_between(sums: &mut [f32], list: &[f32], (before, share): (usize, f32)) {
    let (first, second) = list[before * sums.len()..][..2 * sums.len()].split_at(sums.len());
    for ((sum, first), second) in sums.iter_mut().zip(first).zip(second) {
        *sum += (1.0 - share) * first + share * second;
    }
}

#[cfg(test)]
mod tests {
    use glam::Quat;
    use proptest::prelude::*;

    use super::*;
    use crate::splat::Gaussian;

    /// Gaussians in lattices give the sums that they give in cells, up to a few percent of the largest.
    #[test]
    fn lattices_give_the_sums_of_cells() {
        for (scale, level) in [(7.0, 1), (17.0, 2), (40.0, 3), (60.0, 4), (250.0, 5)] {
            let rotation = Quat::from_xyzw(0.1, 0.7, -0.2, 0.6).normalize();
            let scale = scale * Vec3::new(1.0, 1.3, 1.1);
            let gaussian = Gaussian { position: Vec3::new(70.0, 50.0, 60.0), scale, rotation, opacity: 0.7 };
            let mut splats = Splats::new(0);
            splats.push(gaussian, &[Vec3::new(0.5, -0.2, 0.9)]);
            let wide = CellGaussian::new(&splats, 0, DVec3::ZERO, 1.0, 128, 0.4, None).unwrap();
            assert_eq!(wide.level.min(BLOCK), level);
            let profile = Profile::new();
            let mut largest = 0.0f32;
            let mut differences = Vec::new();
            for low in [UVec3::new(64, 32, 32), UVec3::new(32, 64, 64), UVec3::new(96, 32, 64)] {
                let blocks = [CellGaussian { level: 0, ..wide }, wide].map(|gaussian| {
                    let mut block = Block::new(1);
                    block.add(&gaussian, low, &splats, &profile);
                    block.flatten();
                    block
                });
                for (expected, found) in blocks[0].rasters[0].sums.iter().zip(&blocks[1].rasters[0].sums) {
                    largest = largest.max(expected.abs());
                    differences.push((expected - found).abs());
                }
            }
            let worst = differences.iter().copied().fold(0.0, f32::max) / largest;
            let mean = differences.iter().sum::<f32>() / differences.len() as f32 / largest;
            assert!(worst < 0.08 && mean < 0.01, "{level}: {worst} {mean}");
        }
    }

    proptest! {
        /// Sums of cells are those of the definition, in float64, wherever a Gaussian is followed, and 0 elsewhere. What
        /// follows from neighbors in a column is as accurate as the rest.
        #[test]
        fn sums_are_those_of_the_definition(
            position in prop::array::uniform3(10.0f32..22.0),
            scale in prop::array::uniform3(0.01f32..2.9),
            axes in prop::array::uniform4(-1.0f32..1.0),
            opacity in 0.01f32..1.0,
            blur in 0.1f64..0.5,
        ) {
            let rotation = Quat::from_array(axes);
            prop_assume!(rotation.length() > 0.1);
            let [position, scale] = [position, scale].map(Vec3::from);
            let mut splats = Splats::new(0);
            splats.push(Gaussian { position, scale, rotation: rotation.normalize(), opacity }, &[Vec3::ONE]);
            let own = CellGaussian::new(&splats, 0, DVec3::ZERO, 1.0, 32, blur, None).unwrap();
            prop_assert_eq!(own.level, 0);
            let profile = Profile::new();
            let mut block = Block::new(1);
            block.add(&own, UVec3::ZERO, &splats, &profile);
            let most = own.scale * profile.density(own.opacity);
            for code in 0..1 << (3 * BLOCK) {
                let offset = position_of(code).as_dvec3() + 0.5 - own.center.as_dvec3();
                let distance = offset.dot(own.inverse.as_dmat3() * offset);
                let opacity = f64::from(own.opacity) * (-0.5 * distance).exp();
                let expected = own.scale * profile.density(opacity as f32);
                let found = block.cell(position_of(code))[0];
                let is_at_the_end = (distance / f64::from(own.reach) - 1.0).abs() < 1e-3;
                let is_right = (found - expected).abs() < 1e-4 * most && distance < f64::from(own.reach);
                prop_assert!(is_right || is_at_the_end || found == 0.0 && distance > f64::from(own.reach));
            }
        }
    }

    /// Cells in parts that are wanted have the sums that they have if all are, but for rounding.
    #[test]
    fn sums_of_parts_are_those_of_all() {
        let parts = Parts::some(|part| (part.x + 2 * part.y + part.z).is_multiple_of(3) && part.x != 2).unwrap();
        let profile = Profile::new();
        for scale in [1.0, 7.0, 17.0, 40.0] {
            let mut splats = Splats::new(0);
            let scale = scale * Vec3::new(1.0, 0.7, 1.2);
            let gaussian = Gaussian { position: Vec3::splat(19.3), scale, rotation: Quat::IDENTITY, opacity: 0.7 };
            splats.push(gaussian, &[Vec3::new(0.5, -0.2, 0.9)]);
            let own = CellGaussian::new(&splats, 0, DVec3::ZERO, 1.0, 32, 0.4, None).unwrap();
            let [some, all] = [parts, Parts::ALL].map(|parts| {
                let mut block = Block::new(1);
                block.start(parts);
                block.add(&own, UVec3::ZERO, &splats, &profile);
                block.flatten();
                block
            });
            let wanted = |at: &UVec3| {
                parts
                    .range(at.x as usize, at.y as usize)
                    .is_some_and(|[from, to]| (from..=to).contains(&(at.z as usize)))
            };
            let side = 1 << BLOCK;
            let places = (0..side * side * side).map(|at| UVec3::new(at / side / side, at / side % side, at % side));
            let (mut compared, mut sum) = (0, 0.0);
            for at in places.filter(wanted) {
                for (some, all) in some.cell(at).iter().zip(all.cell(at)) {
                    assert!((some - all).abs() <= 1e-4 * all.abs(), "{scale}: {at}: {some} {all}");
                }
                (compared, sum) = (compared + 1, sum + some.cell(at)[0]);
            }
            assert!(compared > 5000 && sum > 0.0, "{scale}: {compared} cells, {sum}");
        }
    }

    /// The work of a Gaussian is that of all blocks: about the points in its box, those of boundaries once per block.
    #[test]
    fn work_is_that_of_all_blocks() {
        for scale in [1.0, 3.0, 7.0, 17.0, 40.0, 60.0, 250.0] {
            let position = Vec3::new(70.0, 50.0, 60.0);
            let gaussian = Gaussian { position, scale: Vec3::splat(scale), rotation: Quat::IDENTITY, opacity: 0.7 };
            let mut splats = Splats::new(0);
            splats.push(gaussian, &[Vec3::ONE]);
            let lattice = Lattice::new(&splats, DVec3::ZERO, 1.0, 7, 0.4, None);
            let own = lattice.gaussians[0];
            let count = |low: UVec3| {
                let raster = &Block::new(0).rasters[own.level.min(BLOCK) as usize];
                let near = |axis: usize| {
                    let place = |point: usize| low[axis] as f32 + raster.first + raster.distance * point as f32;
                    let is_near = |point: &usize| (place(*point) - own.center[axis]).abs() <= own.extent[axis];
                    (0..raster.side).filter(is_near).count() as f64
                };
                WORK_PER_BLOCK + near(0) * near(1) * near(2)
            };
            let mut expected = 0.0;
            let all = Cube { code: 0, levels: 7, gaussians: vec![&own] };
            all.divide(BLOCK, &mut |block| expected += count(position_of(block.code) << BLOCK));
            let ratio = lattice.work() / expected;
            assert!((0.95..1.3).contains(&ratio), "{scale}: {ratio}");
        }
    }
}
