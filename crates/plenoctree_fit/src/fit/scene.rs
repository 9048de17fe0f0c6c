//! Finds where the field can be, from what the cameras see.

use glam::{DMat3, DVec2, DVec3, UVec3};
use rayon::prelude::*;

use super::{
    error::FitError,
    grid::{Cube, Grid, Voxel, VoxelSet},
    input::{Picture, ViewCamera},
    train::{TrainView, gallery::Gallery},
    turned_box::TurnedBox,
};

/// Voxels per side of the grid in which the scene is searched for.
const RESOLUTION: u32 = 64;
/// Opacity below which a pixel shows nothing, out of 255.
const CLEAR: u8 = 3;
/// Minimum number of known points in view from which a camera's surroundings are estimated.
const FEWEST_POINTS: usize = 50;
/// Maximum number of known points that are searched for in a view.
const MOST_POINTS: usize = 10_000;
/// The nearest that a photograph of a whole scene shows anything, if no points are known, in distances of the camera from
/// the focus.
const NEAREST: f64 = 0.25;
/// Number of times that the cube is enlarged to search again.
const GROWTHS: usize = 3;

/// Where the field can be.
pub struct Place {
    pub cube: Cube,
    /// The voxels that can be occupied, of 64 per side.
    pub voxels: VoxelSet,
}

/// Finds the place of the field. `knows_opacity` says whether the pictures' opacity separates the object from its
/// background. `bounds` is the box to fit, if it is given.
///
/// # Errors
///
/// Returns an error if the cameras have no common view, or if a picture cannot be read.
pub fn find(
    gallery: &mut Gallery,
    points: &[DVec3],
    knows_opacity: bool,
    bounds: Option<TurnedBox>,
) -> Result<Place, FitError> {
    let cameras: Vec<ViewCamera> = gallery.cameras().into_iter().cloned().collect();
    if let Some(bounds) = bounds {
        let (low, high) = bounds.bounds();
        let cube = around(low, high);
        let votes = look(gallery, cube, knows_opacity)?;
        let grid = Votes::grid(cube);
        let is_inside = |position: &UVec3| bounds.overlaps(grid.center(Voxel::cell(*position)), grid.cell_size());
        return nonempty(cube, votes.possible(&cameras, knows_opacity, None).filter(is_inside));
    }

    let (focus, distance) = focus(&cameras)?;
    if !knows_opacity {
        let cube = photographed(points, focus, distance);
        let votes = look(gallery, cube, false)?;
        let nearest: Vec<f64> = cameras.par_iter().map(|camera| nearest(camera, points, focus)).collect();
        return nonempty(cube, votes.possible(&cameras, false, Some(&nearest)));
    }
    // Half of a camera's view at that distance; more if the object turns out to be cut off.
    let wide = median(cameras.iter().map(|camera| {
        let lens = camera.lens;
        0.5 * f64::from(camera.width.max(camera.height)) / lens.focal.min_element()
    }));
    let mut half = distance * wide.min(0.9);
    for growth in 0..=GROWTHS {
        let cube = Cube { low: focus - half, size: 2.0 * half };
        let votes = look(gallery, cube, true)?;
        let grid = Votes::grid(cube);
        let bounds = votes.possible(&cameras, true, None).fold(None, |bounds: Option<(UVec3, UVec3)>, at| {
            Some(bounds.map_or((at, at), |(low, high)| (low.min(at), high.max(at))))
        });
        let Some((low, high)) = bounds else { break };
        let cut_off = low.cmpeq(UVec3::ZERO).any() || high.cmpeq(UVec3::splat(RESOLUTION - 1)).any();
        if cut_off && growth < GROWTHS && half < 0.9 * distance {
            half = (1.5 * half).min(0.95 * distance);
            continue;
        }
        let margin = 0.5 * grid.cell_size();
        let cube = around(
            cube.low + low.as_dvec3() * grid.cell_size() - margin,
            cube.low + (high + 1).as_dvec3() * grid.cell_size() + margin,
        );
        let votes = look(gallery, cube, true)?;
        return nonempty(cube, votes.possible(&cameras, true, None));
    }
    Err(FitError::Views {
        found: format!("no place near {focus:.3} that they agree on: everywhere, some picture shows nothing"),
        expected: "cameras that see one object from around it",
    })
}

/// Returns the place with the voxels at these positions, or an error if there are none.
fn nonempty(cube: Cube, positions: impl Iterator<Item = UVec3>) -> Result<Place, FitError> {
    let voxels = VoxelSet::of(RESOLUTION, positions.map(Voxel::cell));
    if voxels.voxels().next().is_none() {
        let (low, high) = (cube.low, cube.low + cube.size);
        return Err(FitError::Views {
            found: format!("none that shows something in the box from {low:.3} to {high:.3}"),
            expected: "several views of the box",
        });
    }
    Ok(Place { cube, voxels })
}

/// Returns the cube around a box.
fn around(low: DVec3, high: DVec3) -> Cube {
    let size = (high - low).max_element();
    Cube { low: 0.5 * (low + high) - 0.5 * size, size }
}

/// Returns the point nearest to the optical axes of all cameras, and the median distance of the cameras from it. If most
/// cameras do not see it, the more an axis misses it, the less that axis counts: some cameras may look elsewhere.
pub fn focus(cameras: &[ViewCamera]) -> Result<(DVec3, f64), FitError> {
    const ROUNDS: usize = 30;
    let looking = |focus: DVec3| cameras.iter().filter(|camera| camera.project(focus).is_some()).count();
    let mut focus = nearest_to_axes(cameras, |_| 1.0);
    if focus.is_some_and(|focus| 2 * looking(focus) < cameras.len()) {
        for _ in 0..ROUNDS {
            let Some(last) = focus else { break };
            // With these weights, it is the distances whose sum becomes the least, not their squares.
            let miss = |camera: &ViewCamera| camera.axis().cross(last - camera.position).length();
            focus = nearest_to_axes(cameras, |camera| miss(camera).max(1e-9).recip());
        }
    }
    let common = focus.filter(|focus| 2 * looking(*focus) >= cameras.len()).ok_or_else(|| FitError::Views {
        found: format!("{} of {} cameras that look at a common place", focus.map_or(0, looking), cameras.len()),
        expected: "most cameras to look at one object; otherwise, give the box to fit",
    })?;
    Ok((common, median(cameras.iter().map(|camera| camera.position.distance(common)))))
}

/// Returns the point with the least sum of weighted squares of distances from the optical axes, unless they are about
/// parallel.
fn nearest_to_axes(cameras: &[ViewCamera], weight: impl Fn(&ViewCamera) -> f64) -> Option<DVec3> {
    let (mut normal, mut right, mut sum) = (DMat3::ZERO, DVec3::ZERO, 0.0);
    for camera in cameras {
        let (axis, weight) = (camera.axis(), weight(camera));
        sum += weight;
        let across = weight * (DMat3::IDENTITY - DMat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z));
        normal += across;
        right += across * camera.position;
    }
    let spread = normal.determinant() / sum.powi(3);
    Some(normal.inverse() * right).filter(|focus| spread > 1e-6 && focus.is_finite())
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or_default()
}

/// Returns the cube for photographs whose background is part of the scene: around the known points near the focus of
/// the cameras, or else around the focus.
fn photographed(points: &[DVec3], focus: DVec3, distance: f64) -> Cube {
    let reach = 2.0 * distance;
    let seen = |point: &&DVec3| point.distance(focus) < reach;
    let near: Vec<DVec3> = points.iter().filter(seen).copied().collect();
    if near.len() < FEWEST_POINTS {
        let half = 0.95 * distance;
        return Cube { low: focus - half, size: 2.0 * half };
    }
    let end = |axis: usize, share: f64| {
        let mut values: Vec<f64> = near.iter().map(|point| point[axis]).collect();
        values.sort_unstable_by(f64::total_cmp);
        values[((values.len() - 1) as f64 * share) as usize]
    };
    let low = DVec3::from_array(std::array::from_fn(|axis| end(axis, 0.01)));
    let high = DVec3::from_array(std::array::from_fn(|axis| end(axis, 0.99)));
    let margin = 0.05 * (high - low).max_element();
    around(low - margin, high + margin)
}

/// The views' votes on each voxel of a cube.
struct Votes {
    cube: Cube,
    /// Number of views in which the voxel is in the picture, and number of those that show nothing there.
    counts: Vec<[u32; 2]>,
}

impl Votes {
    /// Returns the grid of the votes, without voxels.
    fn grid(cube: Cube) -> Grid {
        Grid::new(cube, 1, &VoxelSet::new(RESOLUTION))
    }

    /// Returns the voxels that can be occupied: those that enough views see and that no view shows to be empty, apart
    /// from a few views whose poses may be wrong, and that are not closer to a camera than its `nearest`.
    fn possible<'a>(
        &'a self,
        cameras: &'a [ViewCamera],
        knows_opacity: bool,
        nearest: Option<&'a [f64]>,
    ) -> impl Iterator<Item = UVec3> + 'a {
        let grid = Self::grid(self.cube);
        // Far from the object, regions that only one or two views see reach to infinity.
        let share = if knows_opacity { 4 } else { 10 };
        let needed = (cameras.len() / share).max(2) as u32;
        let clear = move |at: DVec3| {
            let mut limits = cameras.iter().zip(nearest.unwrap_or_default());
            limits.all(|(camera, nearest)| camera.position.distance(at) >= *nearest)
        };
        let positions = (0..RESOLUTION.pow(3)).map(position);
        positions
            .zip(&self.counts)
            .filter(move |(position, [seen, empty])| {
                *seen >= needed && *empty <= tolerated(*seen) && clear(grid.center(Voxel::cell(*position)))
            })
            .map(|(position, _)| position)
    }
}

/// Returns the distance from a camera below which its photograph shows nothing: nearer than the known points in view,
/// or else than a quarter of the distance to the focus.
fn nearest(camera: &ViewCamera, points: &[DVec3], focus: DVec3) -> f64 {
    let step = points.len().div_ceil(MOST_POINTS).max(1);
    let in_view = points.iter().step_by(step).filter(|point| camera.sees(**point).is_some());
    let mut known: Vec<f64> = in_view.map(|point| camera.position.distance(*point)).collect();
    if known.len() >= FEWEST_POINTS {
        known.sort_unstable_by(f64::total_cmp);
        return 0.8 * known[known.len() / 50];
    }
    NEAREST * camera.position.distance(focus)
}

/// Returns how many of the views that see a voxel may show nothing there, because their poses may be wrong.
fn tolerated(views: u32) -> u32 {
    (views / 12).min(3).max(views / 25)
}

fn position(index: u32) -> UVec3 {
    UVec3::new(index / (RESOLUTION * RESOLUTION), index / RESOLUTION % RESOLUTION, index % RESOLUTION)
}

/// Asks all views about the voxels of a cube.
fn look(gallery: &mut Gallery, cube: Cube, knows_opacity: bool) -> Result<Votes, FitError> {
    let grid = Votes::grid(cube);
    let mut counts = vec![[0; 2]; RESOLUTION.pow(3) as usize];
    let tolerated = tolerated(gallery.len() as u32);
    let mut ask = |view: &TrainView| {
        let opaque = knows_opacity.then(|| Counts::of(view));
        let focal = view.camera.lens.focal.max_element();
        counts.par_iter_mut().enumerate().with_min_len(4096).for_each(|(index, [seen, empty])| {
            if *empty > tolerated {
                return;
            }
            let center = grid.center(Voxel::cell(position(index as u32)));
            if let Some((point, depth)) = view.camera.sees(center) {
                *seen += 1;
                // The whole voxel, and a pixel more.
                let radius = 0.87 * grid.cell_size() * focal / depth.max(1e-9) + 1.0;
                let shown = opaque.as_ref().is_none_or(|opaque| opaque.any(point - radius, point + radius));
                *empty += u32::from(!shown);
            }
        });
    };
    if knows_opacity {
        gallery.each(ask)?;
    } else {
        // Only the cameras count.
        let empty = std::sync::Arc::new(Picture { width: 0, height: 0, pixels: Vec::new(), knows_opacity: false });
        for (number, camera) in gallery.cameras().into_iter().enumerate() {
            ask(&TrainView { number, camera: camera.clone(), picture: empty.clone() });
        }
    }
    Ok(Votes { cube, counts })
}

/// Numbers of pixels that show something, above and to the left of each pixel.
struct Counts {
    columns: usize,
    sums: Vec<u32>,
}

impl Counts {
    /// Counts the pixels of a view. What is not known may show something.
    fn of(TrainView { picture, camera, .. }: &TrainView) -> Self {
        let (width, height) = (picture.width as usize, picture.height as usize);
        let columns = width + 1;
        let mut sums = vec![0; columns * (height + 1)];
        for y in 0..height {
            let mut row = 0;
            for x in 0..width {
                let shows = picture.pixels[y * width + x][3] >= CLEAR || !camera.knows(x as u32, y as u32);
                row += u32::from(shows);
                sums[(y + 1) * columns + x + 1] = sums[y * columns + x + 1] + row;
            }
        }
        Self { columns, sums }
    }

    /// Returns whether a pixel between the two points shows something.
    fn any(&self, low: DVec2, high: DVec2) -> bool {
        let rows = self.sums.len() / self.columns;
        let end = DVec2::new((self.columns - 1) as f64, (rows - 1) as f64);
        let (low, high) = (low.floor().clamp(DVec2::ZERO, end), high.ceil().clamp(DVec2::ZERO, end));
        let sum = |x: f64, y: f64| self.sums[y as usize * self.columns + x as usize];
        sum(high.x, high.y) + sum(low.x, low.y) > sum(low.x, high.y) + sum(high.x, low.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera far away that looks elsewhere does not move the place that all others look at; without such a place,
    /// there is an error.
    #[test]
    fn cameras_look_at_a_common_place() {
        let camera = |position: DVec3, at: DVec3| {
            let back = (position - at).normalize();
            let right = DVec3::Y.cross(back).normalize();
            ViewCamera::centered([40; 2], 60.0, DMat3::from_cols(right, back.cross(right), back), position)
        };
        let at = DVec3::new(0.3, 0.2, 0.1);
        let around = |index: u32| {
            let angle = f64::from(index);
            DVec3::new(4.0 * angle.cos(), 0.1 * angle, 4.0 * angle.sin())
        };
        let mut cameras: Vec<ViewCamera> = (0..20).map(|index| camera(around(index), at)).collect();
        let (alone, distance) = focus(&cameras).unwrap();
        assert!(alone.distance(at) < 1e-9 && (distance - 4.1).abs() < 0.2, "{alone} {distance}");
        cameras.push(camera(DVec3::new(5e3, 300.0, 0.0), DVec3::new(5e3, -1e3, 1e3)));
        let squares = nearest_to_axes(&cameras, |_| 1.0).unwrap();
        assert!(squares.distance(at) > 2.0, "{squares}");
        let (found, _) = focus(&cameras).unwrap();
        assert!(found.distance(at) < 0.2, "{found}");
        let apart: Vec<ViewCamera> = (0..20).map(|index| camera(around(index), 3.0 * around(index))).collect();
        assert!(focus(&apart).is_err());
    }
}
