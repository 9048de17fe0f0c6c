//! The rays of a batch: their colors, their loss, and its gradient.
//!
//! Rays come in tiles of 4 x 4 pixels. The rays of a tile mostly cross the same voxels, in nearly the same directions.
//! So each voxel's color is computed once per tile, in the direction of the tile's center, and its gradient is summed
//! over the tile. A batch leaves a list of these gradients, sorted by blocks of voxels, for [`update`](super::update)
//! to apply.

use std::sync::Mutex;

use glam::{DVec2, DVec3, Vec3, Vec4};
use plenoctree::{Basis, random::Random};
use rayon::prelude::*;

use super::{
    backdrop::{Backdrop, Lookup},
    gallery::TrainView,
};
use crate::{
    exponential::{exp_minus, sigmoid},
    fit::grid::{Crossing, Grid},
};

/// Width of a tile, in pixels.
pub const TILE: u32 = 4;
/// Number of voxels that are updated together.
pub const BLOCK: usize = 1024;
/// Number of parts of a batch, for any number of threads.
pub const PARTS: usize = 32;
/// Transmittance below which a ray ends.
const STOP: f32 = 1e-3;
/// Maximum number of basis functions of a field.
const MOST_FUNCTIONS: usize = 16;

/// A square of pixels of one view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tile {
    pub view: u32,
    /// Left column, in tiles.
    pub x: u16,
    /// Top row, in tiles.
    pub y: u16,
}

/// The gradient with respect to one voxel as one tile sees it.
#[derive(Clone, Copy, Debug, Default)]
pub struct VoxelGradient {
    pub voxel: u32,
    /// Index of the tile in its part.
    pub tile: u32,
    /// With respect to the sums of the harmonics of red, green and blue, and to the thickness.
    pub gradient: [f32; 4],
}

/// A tile's contribution to the rest of the model.
#[derive(Clone, Copy, Debug)]
pub struct TileResult {
    pub view: u32,
    pub rays: u32,
    /// Sums of `rendered x photographed` and of `rendered^2`, whose ratio is the best gain of the view.
    pub gain: [Vec3; 2],
    /// Gradient with respect to the backdrop.
    pub backdrop: Option<(Lookup, Vec3)>,
}

/// The results of a part of a batch.
#[derive(Default)]
pub struct Part {
    /// Sorted by block.
    pub gradients: Vec<VoxelGradient>,
    /// Where the gradients of each block start, and where the last ones end.
    pub starts: Vec<u32>,
    /// The basis in the direction of each tile.
    pub bases: Vec<[f32; MOST_FUNCTIONS]>,
    pub tiles: Vec<TileResult>,
    pub samples: u64,
    unsorted: Vec<VoxelGradient>,
}

/// A voxel on a ray.
struct Sample {
    /// Index among the voxels of the tile.
    slot: u32,
    /// Length of the ray in the voxel, in cells.
    length: f32,
    opacity: f32,
    /// Transmittance before the voxel.
    transmittance: f32,
}

/// Working memory of one thread.
#[derive(Default)]
struct Scratch {
    /// The slot of each voxel, plus `base`, if it was seen in this tile.
    slots: Vec<u32>,
    base: u32,
    voxels: Vec<u32>,
    /// How much the gradient of each voxel counts.
    shares: Vec<f32>,
    colors: Vec<Vec4>,
    gradients: Vec<Vec4>,
    samples: Vec<Sample>,
}

/// Memory that batches reuse.
#[derive(Default)]
pub struct Workspace {
    pub parts: Vec<Part>,
    scratch: Mutex<Vec<Scratch>>,
}

/// The model, and the views that rays are compared with.
pub struct Scene<'a> {
    pub grid: &'a Grid,
    pub views: &'a [TrainView],
    pub backdrop: &'a Backdrop,
    /// The gain of every view, by its number. `views` may be some of all.
    pub gains: &'a [Vec3],
    /// What the squared error of the opacity counts, relative to that of a color channel. 0 if pictures do not know it.
    pub opacity: f32,
    /// Whether gradients fade toward the camera from where the middle of the grid is, with the square of the distance.
    /// Many more rays cross a voxel near a lens, but only those of one view. They would put clouds there that only
    /// this view shows (Philip and Deschaintre 2023, Floaters No More).
    pub fades_near: bool,
}

/// Renders the tiles and computes the gradients. `seed` chooses random backdrops.
pub fn render_batch(scene: &Scene, tiles: &[Tile], seed: u64, workspace: &mut Workspace) {
    match scene.grid.functions() {
        1 => render_parts::<1>(scene, tiles, seed, workspace),
        4 => render_parts::<4>(scene, tiles, seed, workspace),
        16 => render_parts::<16>(scene, tiles, seed, workspace),
        _ => render_parts::<9>(scene, tiles, seed, workspace),
    }
}

fn render_parts<const B: usize>(scene: &Scene, tiles: &[Tile], seed: u64, workspace: &mut Workspace) {
    workspace.parts.resize_with(PARTS, Part::default);
    let per_part = tiles.len().div_ceil(PARTS).max(1);
    let pool = &workspace.scratch;
    workspace.parts.par_iter_mut().enumerate().for_each(|(index, part)| {
        let tiles = tiles.chunks(per_part).nth(index).unwrap_or_default();
        let taken = pool.lock().ok().and_then(|mut pool| pool.pop());
        let mut scratch = taken.unwrap_or_default();
        if scratch.slots.len() != scene.grid.len() {
            scratch.slots = vec![0; scene.grid.len()];
            scratch.base = 1;
        }
        part.clear();
        for (offset, tile) in tiles.iter().enumerate() {
            let seed = Random::of(seed, (index * per_part + offset) as u64);
            render_tile::<B>(scene, *tile, seed, &mut scratch, part);
        }
        part.sort(scene.grid.len());
        if let Ok(mut pool) = pool.lock() {
            pool.push(scratch);
        }
    });
}

fn render_tile<const B: usize>(scene: &Scene, tile: Tile, mut random: Random, scratch: &mut Scratch, part: &mut Part) {
    let grid = scene.grid;
    let view = &scene.views[tile.view as usize];
    let gain = scene.gains[view.number];
    let (left, top) = (u32::from(tile.x) * TILE, u32::from(tile.y) * TILE);
    let (right, bottom) = ((left + TILE).min(view.camera.width), (top + TILE).min(view.camera.height));
    let middle = 0.5 * DVec2::new((left + right).into(), (top + bottom).into());
    let direction = view.camera.direction(middle);
    let y = Basis::Sh16.evaluate(direction);
    let basis: [f32; B] = std::array::from_fn(|function| y[function] as f32);
    let lookup = match scene.backdrop {
        Backdrop::Learned(map) => {
            let lookup = Lookup::new(direction);
            Some((map.color(&lookup), lookup))
        }
        _ => None,
    };

    let Scratch { slots, base, voxels, shares, colors, gradients, samples } = scratch;
    voxels.clear();
    shares.clear();
    samples.clear();
    if *base > u32::MAX / 2 {
        slots.fill(0);
        *base = 1;
    }
    let middle_distance = (grid.cube().distance(view.camera.position) / grid.cell_size()) as f32;
    let mut ends = [(0usize, 0.0f32); (TILE * TILE) as usize];
    let all = || (top..bottom).flat_map(|y| (left..right).map(move |x| (x, y)));
    let pixels = || all().filter(|(x, y)| view.camera.knows(*x, *y));
    for ((x, y), end) in pixels().zip(&mut ends) {
        let direction = view.camera.direction(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
        let ray = grid.ray(view.camera.position, direction);
        let mut transmittance = 1.0f32;
        grid.march(&ray, |Crossing { voxel, start, length }| {
            let mut slot = slots[voxel as usize].wrapping_sub(*base);
            if slot as usize >= voxels.len() {
                slot = voxels.len() as u32;
                slots[voxel as usize] = *base + slot;
                voxels.push(voxel);
                shares.push(if scene.fades_near { (start / middle_distance).powi(2).min(1.0) } else { 1.0 });
            }
            let through = exp_minus(grid.thickness[voxel as usize] * length);
            samples.push(Sample { slot, length, opacity: 1.0 - through, transmittance });
            transmittance *= through;
            transmittance >= STOP
        });
        *end = (samples.len(), transmittance);
    }
    *base += voxels.len() as u32;

    colors.clear();
    colors.extend(voxels.iter().map(|&voxel| color::<B>(grid, voxel, &basis)));
    gradients.clear();
    gradients.resize(voxels.len(), Vec4::ZERO);

    let mut result = TileResult { view: tile.view, rays: 0, gain: [Vec3::ZERO; 2], backdrop: None };
    let mut behind = Vec3::ZERO;
    let mut start = 0;
    for ((x, y), (end, transmittance)) in pixels().zip(ends) {
        let samples = &samples[start..end];
        start = end;
        let [r, g, b, a] = view.picture.pixel(x, y);
        let backdrop = match (scene.backdrop, &lookup) {
            (_, Some((color, _))) => *color,
            (Backdrop::Color(color), _) => *color,
            _ => Vec3::new(random.unit(), random.unit(), random.unit()),
        };
        let photographed = Vec3::new(r, g, b) + (1.0 - a) * backdrop;
        let seen: Vec4 =
            (samples.iter()).map(|sample| sample.transmittance * sample.opacity * colors[sample.slot as usize]).sum();
        let rendered = seen.truncate() + transmittance * backdrop;
        let error = gain * rendered - photographed;
        result.rays += 1;
        result.gain[0] += rendered * photographed;
        result.gain[1] += rendered * rendered;

        let outer = (2.0 * gain * error).extend(2.0 * scene.opacity * (seen.w - a));
        behind += transmittance * outer.truncate();
        // The contribution to `outer . rendered` of the samples behind the current one and of the backdrop.
        let mut rest = outer.dot(seen) + transmittance * outer.truncate().dot(backdrop);
        for sample in samples {
            let color = colors[sample.slot as usize];
            let weight = sample.transmittance * sample.opacity;
            let shown = outer.dot(color);
            rest -= weight * shown;
            let thickness = sample.length * ((sample.transmittance - weight) * shown - rest);
            let mut gradient = weight * outer * color * (Vec4::ONE - color);
            gradient.w = thickness;
            gradients[sample.slot as usize] += gradient;
        }
    }
    result.backdrop = lookup.map(|(_, lookup)| (lookup, behind));

    let index = part.bases.len() as u32;
    let mut stored = [0.0; MOST_FUNCTIONS];
    stored[..B].copy_from_slice(&basis);
    part.bases.push(stored);
    part.tiles.push(result);
    part.samples += samples.len() as u64;
    let found = voxels.iter().zip(shares.iter()).zip(gradients.iter());
    part.unsorted.extend(found.map(|((&voxel, &share), &gradient)| VoxelGradient {
        voxel,
        tile: index,
        gradient: (share * gradient).to_array(),
    }));
}

/// Returns the color of a voxel, and 1 as the fourth element: along a ray, these add up to the opacity.
#[inline]
fn color<const B: usize>(grid: &Grid, voxel: u32, basis: &[f32; B]) -> Vec4 {
    let values = &grid.values[voxel as usize * B..][..B];
    sigmoid(values.iter().zip(basis).map(|(value, y)| *value * *y).sum()).with_w(1.0)
}

/// Returns the color of the grid along a ray, premultiplied, and its transmittance.
pub fn render_ray(grid: &Grid, origin: DVec3, direction: DVec3) -> (Vec3, f32) {
    let y = Basis::Sh16.evaluate(direction);
    let functions = grid.functions();
    let (mut seen, mut transmittance) = (Vec4::ZERO, 1.0f32);
    grid.march(&grid.ray(origin, direction), |Crossing { voxel, length, .. }| {
        let through = exp_minus(grid.thickness[voxel as usize] * length);
        if through < 1.0 {
            let values = &grid.values[voxel as usize * functions..][..functions];
            let sum: Vec4 = values.iter().zip(&y).map(|(value, y)| *value * *y as f32).sum();
            seen += transmittance * (1.0 - through) * sigmoid(sum);
            transmittance *= through;
        }
        transmittance >= STOP
    });
    (seen.truncate(), transmittance)
}

impl Part {
    fn clear(&mut self) {
        self.unsorted.clear();
        self.bases.clear();
        self.tiles.clear();
        self.samples = 0;
    }

    /// Sorts the gradients by block and keeps their order in each: a counting sort.
    fn sort(&mut self, voxels: usize) {
        let blocks = voxels.div_ceil(BLOCK);
        self.starts.clear();
        self.starts.resize(blocks + 1, 0);
        for gradient in &self.unsorted {
            self.starts[gradient.voxel as usize / BLOCK + 1] += 1;
        }
        for block in 0..blocks {
            self.starts[block + 1] += self.starts[block];
        }
        let mut next = self.starts.clone();
        self.gradients.resize(self.unsorted.len(), VoxelGradient::default());
        for gradient in &self.unsorted {
            let place = &mut next[gradient.voxel as usize / BLOCK];
            self.gradients[*place as usize] = *gradient;
            *place += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{DMat3, UVec3};

    use super::*;
    use crate::fit::{
        grid::{Cube, Voxel, VoxelSet},
        input::{Picture, ViewCamera},
        train::backdrop::Backdrop,
    };

    const FUNCTIONS: usize = 9;
    const SIZE: u32 = 6;

    /// A few voxels of different sizes with random values, and a camera that looks at them.
    fn scene(random: &mut Random) -> (Grid, TrainView) {
        let mut set = VoxelSet::new(8);
        for _ in 0..60 {
            let cell = UVec3::from_array(std::array::from_fn(|_| 1 + (random.bits() % 6) as u32));
            if cell.cmpge(UVec3::splat(4)).any() {
                set.insert(Voxel::cell(cell));
            }
        }
        // Larger ones.
        set.insert(Voxel { corner: UVec3::ZERO, size: 4 });
        set.insert(Voxel { corner: UVec3::new(4, 2, 2), size: 2 });
        let mut grid = Grid::new(Cube { low: DVec3::new(-1.0, -0.8, -1.2), size: 2.0 }, FUNCTIONS, &set);
        for voxel in 0..grid.len() {
            for value in &mut grid.values[voxel * FUNCTIONS..][..FUNCTIONS] {
                *value = Vec4::new(random.unit(), random.unit(), random.unit(), 0.5) * 3.0 - Vec4::splat(1.5);
            }
            grid.values[voxel * FUNCTIONS].w = 0.6 * random.unit();
            grid.thickness[voxel] = grid.values[voxel * FUNCTIONS].w;
        }
        let back = DVec3::new(0.4, 0.7, 0.9).normalize();
        let right = DVec3::Y.cross(back).normalize();
        let rotation = DMat3::from_cols(right, back.cross(right), back);
        let mut camera = ViewCamera::centered([SIZE; 2], 7.0, rotation, 3.0 * back);
        camera.lens.center = DVec2::splat(3.1);
        let pixels = (0..SIZE * SIZE)
            .map(|_| {
                let a = random.unit();
                [random.unit() * a, random.unit() * a, random.unit() * a, a].map(|x| (255.0 * x) as u8)
            })
            .collect();
        let picture = Arc::new(Picture { width: SIZE, height: SIZE, pixels, knows_opacity: true });
        (grid, TrainView { number: 1, camera, picture })
    }

    /// All tiles of the view.
    fn tiles() -> Vec<Tile> {
        (0..2).flat_map(|y| (0..2).map(move |x| Tile { view: 0, x, y })).collect()
    }

    /// The loss in float64, from the definition: no slots, no bricks, no early end. `values` are those of the grid.
    fn loss(grid: &Grid, view: &TrainView, backdrop: DVec3, gain: DVec3, opacity: f64, values: &[[f64; 4]]) -> f64 {
        let width = grid.cell_size();
        let mut sum = 0.0;
        for tile in tiles() {
            let low = UVec3::new(tile.x.into(), tile.y.into(), 0) * TILE;
            let high = (low + TILE).min(UVec3::splat(SIZE));
            let middle = 0.5 * DVec2::new((low.x + high.x).into(), (low.y + high.y).into());
            let basis = Basis::Sh9.evaluate(view.camera.direction(middle));
            for (x, y) in (low.y..high.y).flat_map(|y| (low.x..high.x).map(move |x| (x, y))) {
                let direction = view.camera.direction(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
                let mut crossed: Vec<(f64, f64, usize)> = (grid.voxels().enumerate())
                    .filter_map(|(voxel, Voxel { corner, size })| {
                        let corner = grid.cube().low + corner.as_dvec3() * width - view.camera.position;
                        let (a, b) = (corner / direction, (corner + f64::from(size) * width) / direction);
                        let (start, end) = (a.min(b).max_element(), a.max(b).min_element());
                        (end > start).then_some((start, (end - start) / width, voxel))
                    })
                    .collect();
                crossed.sort_by(|a, b| a.0.total_cmp(&b.0));
                let (mut color, mut transmittance) = (DVec3::ZERO, 1.0);
                for (_, length, voxel) in crossed {
                    let values = &values[voxel * FUNCTIONS..][..FUNCTIONS];
                    let through = (-values[0][3] * length).exp();
                    let emitted = DVec3::from_array(std::array::from_fn(|channel| {
                        let sum: f64 = values.iter().zip(&basis).map(|(value, y)| value[channel] * y).sum();
                        1.0 / (1.0 + (-sum).exp())
                    }));
                    color += transmittance * (1.0 - through) * emitted;
                    transmittance *= through;
                }
                let [r, g, b, a] = view.picture.pixels[(y * SIZE + x) as usize].map(|byte| f64::from(byte) / 255.0);
                let photographed = DVec3::new(r, g, b) + (1.0 - a) * backdrop;
                sum += (gain * (color + transmittance * backdrop) - photographed).length_squared();
                sum += opacity * (1.0 - transmittance - a).powi(2);
            }
        }
        sum
    }

    /// The gradient with respect to every value of every voxel is that of finite differences of the loss in float64.
    #[test]
    fn gradients_are_those_of_finite_differences() {
        let mut random = Random::new(7);
        for case in 0..4 {
            let (grid, view) = scene(&mut random);
            let backdrop = Vec3::new(0.9, 0.2, 0.4);
            let gain = Vec3::new(1.1, 0.9, 1.0);
            let mut workspace = Workspace::default();
            let views = [view];
            let opacity = [0.0, 3.0][case % 2];
            // The view is the only one of this batch, and the second one of all.
            let (gains, backdrop_color) = ([Vec3::splat(3.0), gain], Backdrop::Color(backdrop));
            let backdrop_color = &backdrop_color;
            let scene = Scene {
                grid: &grid,
                views: &views,
                backdrop: backdrop_color,
                gains: &gains,
                opacity,
                fades_near: false,
            };
            render_batch(&scene, &tiles(), 0, &mut workspace);
            let mut found = vec![[0.0; 4]; grid.values.len()];
            for part in &workspace.parts {
                for gradient in &part.gradients {
                    let basis = &part.bases[gradient.tile as usize];
                    let values = &mut found[gradient.voxel as usize * FUNCTIONS..][..FUNCTIONS];
                    for (value, y) in values.iter_mut().zip(basis) {
                        (0..3).for_each(|channel| value[channel] += f64::from(gradient.gradient[channel] * y));
                    }
                    values[0][3] += f64::from(gradient.gradient[3]);
                }
            }

            let values: Vec<[f64; 4]> = grid.values.iter().map(|value| value.to_array().map(f64::from)).collect();
            let (backdrop, gain) = (backdrop.as_dvec3(), gain.as_dvec3());
            let largest = found.as_flattened().iter().fold(0.0f64, |largest, value| largest.max(value.abs()));
            assert!(largest > 0.1, "the camera sees the voxels");
            for index in 0..values.len() {
                for element in (0..4).filter(|element| *element < 3 || index % FUNCTIONS == 0) {
                    let at = |step: f64| {
                        let mut moved = values.clone();
                        moved[index][element] += step;
                        loss(&grid, &views[0], backdrop, gain, opacity.into(), &moved)
                    };
                    let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
                    let error = (found[index][element] - difference).abs();
                    assert!(error < 2e-5 * largest, "case {case}, {index}.{element}: {error} of {difference}");
                }
            }
        }
    }

    /// In front of the middle of the grid, gradients count as much as the square of the distance there, and beyond it,
    /// all of them.
    #[test]
    fn gradients_fade_toward_the_camera() {
        let (grid, view) = scene(&mut Random::new(3));
        let position = view.camera.position;
        let middle = position.distance(grid.cube().middle());
        let (views, gains, backdrop) = ([view], [Vec3::ONE; 2], Backdrop::Color(Vec3::ONE));
        let gradients = |fades_near| {
            let mut workspace = Workspace::default();
            let scene =
                Scene { grid: &grid, views: &views, backdrop: &backdrop, gains: &gains, opacity: 0.0, fades_near };
            render_batch(&scene, &tiles(), 0, &mut workspace);
            workspace.parts.into_iter().flat_map(|part| part.gradients).collect::<Vec<_>>()
        };
        let voxels: Vec<Voxel> = grid.voxels().collect();
        let (mut nearer, mut farther) = (0, 0);
        for (whole, faded) in gradients(false).into_iter().zip(gradients(true)) {
            assert_eq!((whole.voxel, whole.tile), (faded.voxel, faded.tile));
            let voxel = voxels[whole.voxel as usize];
            let reach = 0.9 * f64::from(voxel.size) * grid.cell_size();
            let distance = position.distance(grid.center(voxel));
            let share = |distance: f64| (distance / middle).powi(2).min(1.0);
            for (whole, faded) in whole.gradient.map(f64::from).into_iter().zip(faded.gradient.map(f64::from)) {
                let (low, high) = (share(distance - reach) * whole.abs(), share(distance + reach) * whole.abs());
                assert!(faded * whole >= 0.0 && faded.abs() >= 0.999 * low && faded.abs() <= 1.001 * high);
            }
            nearer += u32::from(distance < middle - reach);
            farther += u32::from(distance > middle + reach);
        }
        assert!(nearer > 5 && farther > 5, "{nearer} {farther}");
    }
}
