//! Finds the voxels that the cameras see.

use std::sync::Mutex;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::gallery::TrainView;
use crate::{
    exponential::exp_minus,
    fit::{
        grid::{Crossing, Grid, Voxel, VoxelSet},
        input::ViewCamera,
    },
};

/// Transmittance below which nothing is seen.
const STOP: f32 = 1e-5;
/// Number of cameras from which their rays are farther apart, so that all of them have about as many as this number.
const MANY: f64 = 400.0;
/// Distance, in pixels, of the rays that tell how visible voxels are.
const SEEN_EVERY: u32 = 4;
/// The unit of their sums, which are whole numbers so that the order of rays does not matter.
const SEEN_UNIT: f32 = 1.0 / 256.0;
/// A cloud may end one in so many rays of a camera.
const FEW: usize = 20;
/// What a camera sees that is nearer than this share of the distance at which its other rays end may be a cloud.
const CLEAR_IN_VIEW: f64 = 0.8;
/// The same for anything near it, and the distance at which the rays of most cameras end.
const CLEAR_AROUND: f64 = 0.6;
/// One in so many cameras must see something for it not to be a cloud.
const WITNESSES: usize = 20;
/// The fewest of them.
const FEWEST_WITNESSES: usize = 3;
/// The number of rays that see a voxel that none of them crosses: rays in between may.
const UNSEEN: f32 = 0.01;

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
    /// Whether clouds in front of lenses are removed.
    pub removes_clouds: bool,
}

impl Limits {
    /// For training.
    pub const USUAL: Self = Self {
        weights: [0.03, 0.01, 3e-3, 1e-3],
        loss: 0.04,
        thick_weight: 2e-5,
        thick: 0.05,
        spacing: 1.0,
        most: usize::MAX,
        removes_clouds: false,
    };

    /// For fields that are already right: removes only what is hardly visible.
    pub const FAINTEST: Self = Self { weights: [1e-3; 4], ..Self::USUAL };

    /// Returns whether a voxel is worth keeping.
    fn keep(&self, limit: f32, weight: f32, thickness: f32) -> bool {
        weight > limit || weight > self.thick_weight && thickness > self.thick
    }
}

/// Returns the largest weight that each voxel has on any ray of the cameras. Rays are about `spacing` cells apart, or
/// more if there are many cameras.
pub fn largest_weights(grid: &Grid, cameras: &[&ViewCamera], spacing: f64) -> Vec<f32> {
    let sparseness = sparseness(cameras.len());
    let look = |camera: &&ViewCamera, weights: &mut [f32]| {
        for pixel in pixels(grid, camera, spacing, sparseness) {
            march(grid, camera, pixel, |voxel, _, seen| {
                let weight = &mut weights[voxel as usize];
                *weight = weight.max(seen);
            });
        }
    };
    gathered(grid, cameras, look, f32::max)
}

/// Returns how visible each voxel is in the views: the sum, over rays that cross it, of the squared transmittance of
/// what is in front of it, per area of its face in cells, relative to the number of all rays.
pub fn seen(grid: &Grid, views: &[TrainView]) -> Vec<f32> {
    let every = |size: u32, first: u32| (first % SEEN_EVERY..size).step_by(SEEN_EVERY as usize);
    // Views do not all look through the same pixels.
    let columns = |camera: &ViewCamera, number: usize| every(camera.width, number as u32);
    let rows = |camera: &ViewCamera, number: usize| every(camera.height, number as u32 / SEEN_EVERY);
    let look = |view: &TrainView, sums: &mut [u32]| {
        let camera = &view.camera;
        for y in rows(camera, view.number) {
            for x in columns(camera, view.number) {
                march(grid, camera, DVec2::new(x.into(), y.into()) + 0.5, |voxel, transmittance, _| {
                    let sum = &mut sums[voxel as usize];
                    let square = transmittance * transmittance;
                    *sum = sum.saturating_add((square / SEEN_UNIT).round() as u32);
                });
            }
        }
    };
    let sums = gathered(grid, views, look, u32::saturating_add);
    let rays =
        |TrainView { camera, number, .. }: &TrainView| rows(camera, *number).count() * columns(camera, *number).count();
    let all = views.iter().map(rays).sum::<usize>().max(1) as f32;
    let seen = |(sum, voxel): (u32, Voxel)| (sum as f32 * SEEN_UNIT).max(UNSEEN) / (all * voxel.size.pow(2) as f32);
    sums.into_iter().zip(grid.voxels()).map(seen).collect()
}

/// Returns, for each voxel, what views find out, on all cores. `combine` joins what several find: in any order, the
/// result is the same.
fn gathered<V: Sync, T: Copy + Default + Send>(
    grid: &Grid,
    views: &[V],
    look: impl Fn(&V, &mut [T]) + Sync,
    combine: impl Fn(T, T) -> T,
) -> Vec<T> {
    let pool: Mutex<Vec<Vec<T>>> = Mutex::default();
    views.par_iter().for_each(|view| {
        let taken = pool.lock().ok().and_then(|mut pool| pool.pop());
        let mut found = taken.unwrap_or_else(|| vec![T::default(); grid.len()]);
        look(view, &mut found);
        if let Ok(mut pool) = pool.lock() {
            pool.push(found);
        }
    });
    let mut all = vec![T::default(); grid.len()];
    for found in pool.into_inner().unwrap_or_default() {
        all.iter_mut().zip(found).for_each(|(all, found)| *all = combine(*all, found));
    }
    all
}

/// The space in front of a lens in which there are only clouds, unless other cameras see the same. Such clouds show the
/// picture of this camera alone, even if its pose is wrong.
struct Clear<'a> {
    camera: &'a ViewCamera,
    /// Distance of the camera from the middle of the grid.
    to_middle: f64,
    /// Distance from the camera up to which there is nothing on the side of the middle.
    around: f64,
    /// The same for what the camera sees.
    in_view: f64,
}

impl<'a> Clear<'a> {
    /// Finds the clear space of all cameras from where their rays end.
    fn of(grid: &Grid, cameras: &[&'a ViewCamera]) -> Vec<Self> {
        let near_end = |camera: &&ViewCamera| {
            let mut ends: Vec<f32> = Vec::new();
            for pixel in pixels(grid, camera, 4.0, sparseness(cameras.len())) {
                let mut transmittance = 1.0f32;
                grid.march(&grid.ray(camera.position, camera.direction(pixel)), |Crossing { voxel, start, length }| {
                    transmittance *= exp_minus(grid.thickness[voxel as usize] * length);
                    if transmittance < 0.5 {
                        ends.push(start);
                    }
                    transmittance >= 0.5
                });
            }
            ends.sort_unstable_by(f32::total_cmp);
            ends.get(ends.len() / FEW).map(|cells| f64::from(*cells) * grid.cell_size())
        };
        let near_ends: Vec<Option<f64>> = cameras.par_iter().map(near_end).collect();
        let to_middle = |camera: &ViewCamera| grid.cube().distance(camera.position);
        let ratio = |(camera, end): (&&ViewCamera, &Option<f64>)| end.map(|end| end / to_middle(camera));
        let mut ratios: Vec<f64> = cameras.iter().zip(&near_ends).filter_map(ratio).collect();
        ratios.sort_unstable_by(f64::total_cmp);
        let usual = ratios.get(ratios.len() / 2).copied().unwrap_or_default();
        let clear = |(camera, end): (&&'a ViewCamera, &Option<f64>)| Self {
            camera: *camera,
            to_middle: to_middle(camera),
            around: CLEAR_AROUND * usual * to_middle(camera),
            in_view: CLEAR_IN_VIEW * end.unwrap_or_default(),
        };
        cameras.iter().zip(&near_ends).map(clear).collect()
    }

    /// Returns whether it contains a voxel.
    fn contains(&self, grid: &Grid, voxel: Voxel) -> bool {
        let center = grid.center(voxel);
        let distance = self.camera.position.distance(center);
        let half = 0.5 * f64::from(voxel.size) * grid.cell_size();
        let sign = |index: u32, axis: u32| if index >> axis & 1 == 1 { half } else { -half };
        let corner = |index| center + DVec3::new(sign(index, 0), sign(index, 1), sign(index, 2));
        distance < self.around && center.distance(grid.cube().middle()) < self.to_middle
            || distance < self.in_view && (0..8).any(|index| self.camera.sees(corner(index)).is_some())
    }
}

/// Returns whether each voxel is a cloud in front of a lens: it is in the clear space of a camera, and few cameras see it
/// nearer than the middle of the grid with more than this weight.
fn clouds(grid: &Grid, cameras: &[&ViewCamera], limit: f32) -> Vec<bool> {
    let clear = Clear::of(grid, cameras);
    let voxels: Vec<Voxel> = grid.voxels().collect();
    let numbered: Vec<(u32, &Clear)> = (1..).zip(&clear).collect();
    // The number of cameras that see a voxel, and the last of them.
    let look = |(number, clear): &(u32, &Clear), seen: &mut [(u32, u32)]| {
        for pixel in pixels(grid, clear.camera, 1.0, sparseness(cameras.len())) {
            march(grid, clear.camera, pixel, |voxel, _, weight| {
                let (count, last) = &mut seen[voxel as usize];
                if weight > limit && *last != *number {
                    *last = *number;
                    let voxel = voxels[voxel as usize];
                    let distance = clear.camera.position.distance(grid.center(voxel));
                    *count += u32::from(distance < clear.to_middle);
                }
            });
        }
    };
    let seen = gathered(grid, &numbered, look, |a, b| (a.0 + b.0, 0));
    let needed = (cameras.len() / WITNESSES).max(FEWEST_WITNESSES) as u32;
    let is_cloud = |(voxel, (count, _)): (&Voxel, (u32, u32))| {
        count < needed && clear.iter().any(|clear| clear.contains(grid, *voxel))
    };
    voxels.par_iter().zip(seen).map(is_cloud).collect()
}

/// Returns how many times farther apart the rays of this number of cameras are.
fn sparseness(cameras: usize) -> f64 {
    (cameras as f64 / MANY).max(1.0).sqrt()
}

/// Returns the known points of the picture whose rays are about `spacing` cells apart in the middle of the grid, or
/// `sparseness` times that.
fn pixels(grid: &Grid, camera: &ViewCamera, spacing: f64, sparseness: f64) -> impl Iterator<Item = DVec2> {
    let pixels = spacing * grid.cell_size() * camera.lens.focal.x / grid.cube().distance(camera.position);
    let step = (pixels.clamp(0.1, 4.0) * sparseness).min(camera.width.min(camera.height).into());
    let count = move |size: u32| (f64::from(size) / step) as u32;
    let every = move |size: u32| (0..count(size)).map(move |index| (f64::from(index) + 0.5) * step);
    let width = camera.width;
    let all = every(camera.height).flat_map(move |y| every(width).map(move |x| DVec2::new(x, y)));
    all.filter(|point| camera.knows(point.x as u32, point.y as u32))
}

/// Calls `visit` with the voxels that a ray sees, the transmittance of what is in front of them, and their weights.
fn march(grid: &Grid, camera: &ViewCamera, pixel: DVec2, mut visit: impl FnMut(u32, f32, f32)) {
    let mut transmittance = 1.0f32;
    grid.march(&grid.ray(camera.position, camera.direction(pixel)), |Crossing { voxel, length, .. }| {
        let through = exp_minus(grid.thickness[voxel as usize] * length);
        visit(voxel, transmittance, transmittance * (1.0 - through));
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
            march(grid, camera, pixel, |voxel, _, seen| {
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
    let clouds = if limits.removes_clouds { clouds(grid, cameras, limit) } else { vec![false; grid.len()] };
    let mut kept: Vec<(Voxel, f32)> = (grid.voxels().zip(weights).zip(&grid.thickness).zip(clouds))
        .filter(|(((_, weight), thickness), is_cloud)| limits.keep(limit, *weight, **thickness) && !is_cloud)
        .map(|((kept, _), _)| kept)
        .collect();
    kept.sort_by(|(_, a), (_, b)| b.total_cmp(a));
    VoxelSet::of(grid.resolution(), kept.into_iter().take(limits.most).map(|(voxel, _)| voxel))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{DMat3, DVec3, UVec3, Vec4};

    use super::*;
    use crate::fit::{grid::Cube, input::Picture};

    /// A camera that sees all of a cube around the origin.
    fn camera() -> ViewCamera {
        ViewCamera::centered([64; 2], 40.0, DMat3::IDENTITY, DVec3::new(0.0, 0.0, 4.0))
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
            let kept = visible(&grid, &[&camera()], Limits { spacing: 0.5, ..Limits::USUAL });
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
        let kept = visible(&grid, &[&camera()], Limits { spacing: 0.5, most: 1000, ..Limits::USUAL });
        assert_eq!(kept.voxels().count(), 1000);
        assert!(kept.voxels().all(|voxel| voxel.corner.z >= 58));
    }

    /// What faces the views is as visible as it is large in them, and what is behind it as little as what no ray crosses.
    /// The number of threads does not matter.
    #[test]
    fn what_is_in_front_is_seen() {
        let grid = grid(|at| if (30..34).contains(&at.z) { 3.0 } else { 0.0 });
        let seen_on = |threads: usize| {
            let view = |number: usize| {
                let picture = Arc::new(Picture { width: 0, height: 0, pixels: Vec::new(), knows_opacity: true });
                TrainView { number, camera: camera(), picture }
            };
            let views: Vec<TrainView> = (0..2).map(view).collect();
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| seen(&grid, &views))
        };
        let seen = seen_on(1);
        assert_eq!(seen, seen_on(3));
        // Two views with 16 x 16 rays each.
        let unseen = UNSEEN / 512.0;
        let layer = grid.voxels().zip(&seen).filter(|(voxel, _)| voxel.corner.z == 33);
        let front: f32 = layer.map(|(_, seen)| *seen).filter(|seen| *seen > 2.0 * unseen).sum();
        // The camera looks at the side of greater z, which fills a tenth of the picture.
        assert!((front - 0.1).abs() < 0.05, "{front}");
        let mut back = grid.voxels().zip(&seen).filter(|(voxel, _)| voxel.corner.z == 30);
        assert!(back.all(|(_, seen)| (*seen / unseen - 1.0).abs() < 1e-3));
    }

    /// A camera that looks at the origin from this direction, 1.2 units away.
    fn near(turn: f64, up: f64) -> ViewCamera {
        let rotation = DMat3::from_rotation_y(turn) * DMat3::from_rotation_x(-up);
        ViewCamera::centered([64; 2], 60.0, rotation, 1.2 * rotation.z_axis)
    }

    /// Of what is near a lens, only what other cameras do not see is a cloud.
    #[test]
    fn clouds_in_front_of_lenses_are_removed() {
        let cameras: Vec<_> = (0..12).map(|index| near(f64::from(index) * 0.5, 0.8)).collect();
        let at = |position: UVec3| (position.as_dvec3() + 0.5) / 32.0 - 1.0;
        let cloud = |at: DVec3| at.distance(0.8 * cameras[4].position) < 0.1;
        // It fills less than a twentieth of the pictures, and is nearer than the ground, which fills the rest.
        let ball = |at: DVec3| at.distance(DVec3::new(0.0, 0.15, 0.0)) < 0.1;
        let ground = |at: DVec3| at.y < -0.5;
        let grid =
            grid(|cell| if [cloud(at(cell)), ball(at(cell)), ground(at(cell))].contains(&true) { 3.0 } else { 0.0 });
        let count = |removes_clouds: bool, is_part: &dyn Fn(DVec3) -> bool| {
            let set = visible(&grid, &cameras.iter().collect::<Vec<_>>(), Limits { removes_clouds, ..Limits::USUAL });
            set.voxels().filter(|voxel| is_part(grid.center(*voxel))).count()
        };
        let (all, left) = (count(false, &cloud), count(true, &cloud));
        assert!(all > 50 && left == 0, "{left} of {all}");
        for part in [&ball as &dyn Fn(DVec3) -> bool, &ground] {
            let (all, left) = (count(false, part), count(true, part));
            // Few cameras see the rest of the ball, which is below.
            assert!(all > 50 && left * 10 > all * 9, "{left} of {all}");
        }
    }

    /// Thousands of cameras cast about as many rays as hundreds, and see about the same voxels.
    #[test]
    fn many_cameras_take_no_longer() {
        let shell = |at: UVec3| (at.as_dvec3() + 0.5 - 32.0).length();
        let grid = grid(|at| if (20.0..30.0).contains(&shell(at)) { 40.0 } else { 0.0 });
        let around = |index: usize, count: usize| {
            let (turn, up) = (2.4 * index as f64, 1.0 - (2 * index + 1) as f64 / count as f64);
            let rotation = DMat3::from_rotation_y(turn) * DMat3::from_rotation_x(-up.asin());
            ViewCamera::centered([128; 2], 80.0, rotation, 4.0 * rotation.z_axis)
        };
        let seen = |count: usize| {
            let cameras: Vec<_> = (0..count).map(|index| around(index, count)).collect();
            let rays: usize = cameras.iter().map(|camera| pixels(&grid, camera, 1.0, sparseness(count)).count()).sum();
            let set = visible(&grid, &cameras.iter().collect::<Vec<_>>(), Limits::USUAL);
            (rays, set.voxels().collect::<Vec<_>>())
        };
        let ((few_rays, few), (many_rays, many)) = (seen(400), seen(6400));
        assert!(many_rays < few_rays * 5 / 4, "{many_rays} rays instead of {few_rays}");
        let both = few.iter().filter(|voxel| many.contains(voxel)).count();
        assert!(few.len() > 5000, "{}", few.len());
        assert!(both * 100 > few.len() * 95, "{both} of {}", few.len());
    }
}
