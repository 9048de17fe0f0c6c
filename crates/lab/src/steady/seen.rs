//! What a camera sees of a field, and where another one sees the same.

use glam::DVec3;
use plenoctree::{FieldHit, PlenOctree, camera::PinholeCamera};
use rayon::prelude::*;

/// The hits of a frame, one per pixel.
pub struct Seen {
    camera: PinholeCamera,
    pub hits: Vec<Option<FieldHit>>,
}

impl Seen {
    pub fn new(field: &PlenOctree, camera: &PinholeCamera) -> Self {
        let (width, height) = (camera.width as usize, camera.height as usize);
        let hit = |index: usize| {
            let (origin, direction) = camera.ray((index % width) as f64 + 0.5, (index / width) as f64 + 0.5);
            field.cast_ray(origin, direction)
        };
        Self { camera: *camera, hits: (0..width * height).into_par_iter().map(hit).collect() }
    }

    /// Returns the pixel that shows a point, if the point is what it sees.
    fn pixel_of(&self, point: DVec3) -> Option<usize> {
        let camera = &self.camera;
        let local = camera.rotation.transpose() * (point - camera.position);
        let x = camera.center_x - camera.focal_x * local.x / local.z;
        let y = camera.center_y + camera.focal_y * local.y / local.z;
        let is_inside = x >= 0.0 && y >= 0.0 && x < f64::from(camera.width) && y < f64::from(camera.height);
        let index = is_inside.then(|| y as usize * camera.width as usize + x as usize)?;
        let distance = point.distance(camera.position);
        let found = self.hits[index]?.distance;
        ((found - distance).abs() < SAME * distance).then_some(index)
    }

    fn found_in(&self, other: &Self) -> Vec<(usize, usize)> {
        let hits = self.hits.iter().enumerate();
        hits.filter_map(|(index, hit)| Some((index, other.pixel_of(hit.as_ref()?.point)?))).collect()
    }
}

/// The largest difference of distances at which two frames see the same, relative to the distance.
const SAME: f64 = 0.005;

/// Two frames.
pub struct Pair {
    forward: Vec<(usize, usize)>,
    backward: Vec<(usize, usize)>,
    size: [usize; 2],
}

impl Pair {
    pub fn new(before: &Seen, after: &Seen) -> Self {
        let size = [before.camera.width as usize, before.camera.height as usize];
        Self { forward: after.found_in(before), backward: before.found_in(after), size }
    }

    /// Returns the pixels of the second frame, and where the first one saw the same.
    pub fn forward(&self) -> impl Iterator<Item = (usize, usize)> {
        self.forward.iter().copied()
    }

    /// Returns the pixels of the first frame, and where the second one sees the same.
    pub fn backward(&self) -> impl Iterator<Item = (usize, usize)> {
        self.backward.iter().copied()
    }

    /// Returns a pixel and those around it.
    pub fn around(&self, pixel: usize) -> impl Iterator<Item = usize> {
        let [width, height] = self.size;
        let (x, y) = (pixel % width, pixel / width);
        let rows = y.saturating_sub(1)..(y + 2).min(height);
        rows.flat_map(move |y| (x.saturating_sub(1)..(x + 2).min(width)).map(move |x| y * width + x))
    }
}
