//! Path-traced pictures of a prop, to which a field can be fitted. Light reaches the camera over several surfaces.

use std::{f64::consts::TAU, path::Path};

use glam::{DVec2, DVec3, I64Vec3};
use image::{Rgba, RgbaImage};
use indicatif::ProgressBar;
use plenoctree::{
    UpAxis,
    camera::{PinholeCamera, Spiral},
};
use plenoctree_cli::{files, result::Result, transforms};
use rayon::prelude::*;

use super::{
    noise::hash,
    prop::Prop,
    shade::{self, Material},
};

/// The horizontal field of view of the cameras, in radians.
const FOV: f64 = 0.7;
/// The distances along an axis of their grid.
const SAMPLES: usize = 224;
/// The rays through a pixel, across and down.
const RAYS: u32 = 2;
/// The paths from where a ray meets the prop.
const PATHS: usize = 3;
/// The largest number of surfaces on a path.
const BOUNCES: usize = 5;
/// The most light that a path adds after its first surface: a few bright paths are noise.
const MOST_LIGHT: f64 = 3.0;

/// Takes `count` pictures of the prop, with opacity, from above to slightly below. They are evenly spread, and
/// do not show glass. Writes them to `folder`, with a `transforms.json` file.
pub fn photograph<T: Prop>(prop: &T, folder: &Path, count: u32, size: u32, bar: &ProgressBar) -> Result {
    files::create_folder(folder)?;
    let studio = Studio::new(prop);
    let elevations = [0.98, -0.35];
    let spiral = Spiral { center: T::CENTER, radius: T::RADIUS, up: UpAxis::Z, fov: FOV, elevations, distances: &[] };
    bar.set_length(count.into());
    let mut pictures = Vec::new();
    for (index, camera) in spiral.cameras(count, size).enumerate() {
        let name = format!("view_{index:03}.png");
        files::write_image(&folder.join(&name), &studio.photograph(&camera, index as u64))?;
        pictures.push((name, camera));
        bar.inc(1);
    }
    bar.finish_and_clear();
    transforms::write(folder, FOV, &pictures)?;
    Ok(())
}

/// A prop in the studio.
struct Studio<'a, T> {
    prop: &'a T,
    /// Signed distances at the corners of cells.
    distances: Vec<f32>,
    /// The width of a cell.
    cell: f64,
}

impl<'a, T: Prop> Studio<'a, T> {
    /// Measures the distances.
    fn new(prop: &'a T) -> Self {
        let cell = 2.0 * T::HALF / (SAMPLES - 1) as f64;
        let distances = (0..SAMPLES.pow(3))
            .into_par_iter()
            .map(|index| {
                let corner = I64Vec3::new(
                    (index / (SAMPLES * SAMPLES)) as i64,
                    (index / SAMPLES % SAMPLES) as i64,
                    (index % SAMPLES) as i64,
                );
                prop.nearest(corner.as_dvec3() * cell - T::HALF).distance as f32
            })
            .collect();
        Self { prop, distances, cell }
    }

    /// Takes a picture, with straight opacity.
    fn photograph(&self, camera: &PinholeCamera, seed: u64) -> RgbaImage {
        let (width, height) = (camera.width, camera.height);
        let rows: Vec<Vec<[u8; 4]>> =
            (0..height).into_par_iter().map(|y| (0..width).map(|x| self.pixel(camera, x, y, seed)).collect()).collect();
        RgbaImage::from_fn(width, height, |x, y| Rgba(rows[y as usize][x as usize]))
    }

    fn pixel(&self, camera: &PinholeCamera, x: u32, y: u32, seed: u64) -> [u8; 4] {
        let mut random = Random { place: I64Vec3::new(x.into(), y.into(), 0), seed };
        let (mut light, mut hits) = (DVec3::ZERO, 0);
        for ray in 0..RAYS * RAYS {
            let at = |index: u32, random: f64| (f64::from(index) + random) / f64::from(RAYS);
            let (dx, dy) = (at(ray % RAYS, random.next()), at(ray / RAYS, random.next()));
            let (origin, direction) = camera.ray(f64::from(x) + dx, f64::from(y) + dy);
            if let Some(point) = self.trace(origin, direction, true) {
                hits += 1;
                let surface = self.surface(point);
                light += (0..PATHS).map(|_| self.path(&surface, direction, &mut random)).sum::<DVec3>() / PATHS as f64;
            }
        }
        if hits == 0 {
            return [0; 4];
        }
        let color = (light / f64::from(hits)).map(shade::expose);
        let [r, g, b] = color.to_array().map(|channel| (255.0 * channel).round() as u8);
        [r, g, b, (255 * hits / (RAYS * RAYS)) as u8]
    }

    /// Returns the light along a random path that leaves `surface` against `direction`.
    fn path(&self, surface: &Surface, direction: DVec3, random: &mut Random) -> DVec3 {
        let (mut sum, mut weight) = (DVec3::ZERO, DVec3::ONE);
        let (mut surface, mut direction) = (*surface, direction);
        for bounce in 0..BOUNCES {
            let Surface { point, normal, material } = surface;
            let start = point + 1.3 * self.cell * normal;
            let toward = shade::toward_key(random.disk());
            let lit = normal.dot(toward) > 0.0 && self.trace(start, toward, false).is_none();
            let most = if bounce == 0 { f64::INFINITY } else { MOST_LIGHT };
            let limited = |light: DVec3| light.min(DVec3::splat(most));
            sum += limited(weight * material.reflected(normal, -direction, toward, lit));
            let (next, share) = material.bounce(normal, -direction, [random.next(), random.next(), random.next()]);
            weight *= share;
            if weight.max_element() < 0.01 {
                break;
            }
            direction = next;
            match self.trace(start, direction, false) {
                Some(point) => surface = self.surface(point),
                None => {
                    sum += limited(weight * shade::sky(direction));
                    break;
                }
            }
        }
        sum
    }

    fn surface(&self, point: DVec3) -> Surface {
        let step = 0.3 * self.cell;
        let corners = [(1.0, 1.0, 1.0), (1.0, -1.0, -1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0)];
        let slope = corners.map(|(x, y, z)| {
            let corner = DVec3::new(x, y, z);
            self.prop.nearest(point + step * corner).distance * corner
        });
        let normal = slope.into_iter().sum::<DVec3>().normalize_or(DVec3::Z);
        let material = self.prop.material(self.prop.nearest(point).part, point);
        Surface { point, normal, material }
    }

    /// Returns where a ray meets the prop: exactly, or as precisely as the grid.
    fn trace(&self, origin: DVec3, direction: DVec3, exact: bool) -> Option<DVec3> {
        let inverse = direction.recip();
        let (a, b) = ((-T::HALF - origin) * inverse, (T::HALF - origin) * inverse);
        let (mut t, end) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
        for _ in 0..400 {
            if t >= end {
                return None;
            }
            let point = origin + t * direction;
            let mut free = self.distance(point);
            if exact && free < 1.5 * self.cell {
                free = self.prop.nearest(point).distance;
                if free < 0.01 * self.cell {
                    return Some(point);
                }
            } else if free < 0.2 * self.cell {
                return Some(point);
            }
            t += free.max(0.05 * self.cell);
        }
        None
    }

    /// Returns the distance at a point, interpolated in the grid.
    fn distance(&self, point: DVec3) -> f64 {
        let place = ((point + T::HALF) / self.cell).clamp(DVec3::ZERO, DVec3::splat((SAMPLES - 1) as f64 - 1e-6));
        let corner = place.floor();
        let blend = (place - corner).as_vec3();
        let [x, y, z] = corner.as_u64vec3().to_array().map(|value| value as usize);
        let first = (x * SAMPLES + y) * SAMPLES + z;
        let along = |index: usize| {
            let (low, high) = (self.distances[index], self.distances[index + 1]);
            low + (high - low) * blend.z
        };
        let plane = |index: usize| {
            let (low, high) = (along(index), along(index + SAMPLES));
            low + (high - low) * blend.y
        };
        let (low, high) = (plane(first), plane(first + SAMPLES * SAMPLES));
        f64::from(low + (high - low) * blend.x)
    }
}

/// A point of the prop's surface.
#[derive(Clone, Copy)]
struct Surface {
    point: DVec3,
    normal: DVec3,
    material: Material,
}

/// Random numbers of a pixel.
struct Random {
    place: I64Vec3,
    seed: u64,
}

impl Random {
    fn next(&mut self) -> f64 {
        self.place.z += 1;
        hash(self.place, self.seed)
    }

    /// Returns a point in the unit disk.
    fn disk(&mut self) -> DVec2 {
        DVec2::from_angle(TAU * self.next()) * self.next().sqrt()
    }
}
