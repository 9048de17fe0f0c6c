//! Simplifies fields, so that they pack into fewer bytes while their pictures hardly change.

use glam::Vec4;
use plenoctree::{
    PlenOctree,
    camera::{PinholeCamera, Spiral},
};
use rayon::prelude::*;

use super::{
    error::FitError,
    grid::{Grid, Voxel},
    progress::FitProgress,
    refine::{Shot, refine_by, views},
    settings::check_effort,
    to_field::to_field,
    train::{
        Stage,
        batch::render_ray,
        gallery::Gallery,
        visibility::{self, Limits},
    },
};

/// Cameras above the horizon, and below.
const CAMERAS: [u32; 2] = [64, 16];
/// Field of view, in radians.
const FOV: f64 = 0.6;
/// Distances, as multiples of the one at which the whole field is in view.
const DISTANCES: [f64; 3] = [1.0, 0.85, 0.7];
/// Width of pictures in cells, and the largest, in pixels.
const PIXELS_PER_CELL: f64 = 2.4;
const MOST_PIXELS: f64 = 400.0;

/// Settings of [`simplify`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimplifySettings {
    /// Penalty on colors that change with the view direction: the cost of a squared coefficient, relative to that of a
    /// pixel's squared error. Where pictures show the change, their error outweighs it. 0 or more, 4e-5 by default.
    pub smoothness: f32,
    /// Penalty on different colors of neighboring leaves: the cost of a difference of 1 between their coefficients of
    /// the constant function, in the same unit. 0 or more, 4e-5 by default.
    pub evenness: f32,
    /// How much work to do, as a multiple of the default, which is 8 million rays. Above 0, 1 by default.
    pub effort: f64,
    /// Seed of the random numbers. The same seed gives the same field, on any number of threads.
    pub seed: u64,
}

impl Default for SimplifySettings {
    fn default() -> Self {
        Self { smoothness: 4e-5, evenness: 4e-5, effort: 1.0, seed: 0 }
    }
}

impl SimplifySettings {
    /// Returns an error that names the first setting that is out of range.
    fn validate(&self) -> Result<(), FitError> {
        for (setting, penalty) in [("smoothness", self.smoothness), ("evenness", self.evenness)] {
            if !(penalty >= 0.0 && penalty.is_finite()) {
                return Err(FitError::Setting { setting, found: penalty.to_string(), expected: "a number, 0 or more" });
            }
        }
        check_effort(self.effort)
    }
}

/// Returns a field with fewer leaves and smoother colors, whose pictures from outside are nearly those of `field`, on
/// all cores of the current rayon pool. Recorded [histograms](PlenOctree::histograms) stay.
///
/// The field is rendered from all around, and [refined](crate::refine()) to match these pictures without leaves that
/// hardly matter. Meanwhile, differences between view directions are pulled toward 0, and the colors of neighbors
/// toward each other. This removes what training left in places and directions that hardly show, and that a packed
/// field would have to store.
///
/// If `progress` is stopped, the field is only partly simplified, or as it was.
///
/// # Errors
///
/// Returns an error if a setting is out of range, or if the field is not of the kind that is fitted: a cube of 6 to 10
/// levels, with leaves of at most four finest cells a side, and a sigmoid of harmonics up to degree 3.
pub fn simplify(
    field: &PlenOctree,
    settings: &SimplifySettings,
    progress: &FitProgress,
) -> Result<PlenOctree, FitError> {
    settings.validate()?;
    let grid = Grid::of_field_or_error(field, Voxel::LARGEST)?;
    let cells = f64::from(grid.resolution());
    let size = (PIXELS_PER_CELL * cells).min(MOST_PIXELS);
    progress.update(|status| status.stage = "drawing".into());
    let draw = |camera: &PinholeCamera| (!progress.is_stopped()).then(|| photograph(&grid, camera));
    let Some(shots) = cameras(field, size as u32).par_iter().map(draw).collect::<Option<Vec<Shot>>>() else {
        return Ok(field.clone());
    };
    // A voxel's errors count once for each pixel that it covers.
    let pixels = (size / cells).powi(2) as f32;
    let (direction, color) = (settings.smoothness * pixels, settings.evenness * pixels);
    let stage = Stage::simplifying(grid.resolution(), settings.effort, direction, color);
    let limits = Limits { spacing: 0.7, ..Limits::FAINTEST };
    let mut gallery = Gallery::held(views(&shots));
    let grid = refine_by(grid, &mut gallery, &[], &[stage], settings.seed, progress)?.grid;
    let simple = to_field(&grid, &visibility::visible(&grid, &gallery.cameras(), limits))?;
    Ok(simple.with_up(field.up()).with_histograms_of(field))
}

fn photograph(grid: &Grid, camera: &PinholeCamera) -> Shot {
    let pixel = |pixel: u32| {
        let (x, y) = (pixel % camera.width, pixel / camera.width);
        let (origin, direction) = camera.ray(f64::from(x) + 0.5, f64::from(y) + 0.5);
        let (seen, through) = render_ray(grid, origin, direction);
        seen.extend(1.0 - through)
    };
    let pixels: Vec<Vec4> = (0..camera.width * camera.height).map(pixel).collect();
    Shot::new(camera, &pixels)
}

/// Returns cameras all around the field, on spirals from the horizon to the top and to the bottom.
fn cameras(field: &PlenOctree, size: u32) -> Vec<PinholeCamera> {
    let Some((low, high)) = field.dense_bounds() else { return Vec::new() };
    let spiral = |elevations| Spiral {
        center: 0.5 * (low + high),
        radius: 0.5 * (high - low).length(),
        up: field.up(),
        fov: FOV,
        elevations,
        distances: &DISTANCES,
    };
    let [above, below] = CAMERAS;
    spiral([0.0, 1.0]).cameras(above, size).chain(spiral([0.0, -1.0]).cameras(below, size)).collect()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use plenoctree::{
        BakeSettings, Basis, PackSettings, Packed, UpAxis, bake,
        sampling::{Progress, SamplingSettings},
    };

    /// A ball in haze, with noisy colors, becomes a ball with smoother colors that looks the same.
    #[test]
    fn simple_fields_look_the_same() {
        let settings =
            BakeSettings { depth: 6, basis: Basis::Sh4, up: UpAxis::Y, min_density: 0.0, ..Default::default() };
        let density = |at: DVec3| if at.length() < 0.7 { 60.0 } else { 0.01 };
        let tint = |at: DVec3| {
            let [noise, grain] =
                [DVec3::new(1.0, 1.7, 2.3), DVec3::new(2.9, 1.3, 1.9)].map(|k| (1e4 * at.dot(k)).sin());
            move |direction: DVec3| 0.5 + 0.3 * at + 0.05 * grain + 0.2 * noise * direction.x
        };
        let field = bake(&settings, density, tint).unwrap();
        let settings = SimplifySettings { smoothness: 2e-3, evenness: 5e-4, effort: 0.05, ..Default::default() };
        let simple = simplify(&field, &settings, &FitProgress::default()).unwrap();
        assert!(simple.leaves() < field.leaves() / 2, "{} of {}", simple.leaves(), field.leaves());
        assert_eq!(simple.up(), UpAxis::Y);
        let camera = PinholeCamera::around(&simple, 40, 40, 0.7, -0.4).unwrap();
        let mut worst = 0.0f64;
        for pixel in 0..1600 {
            let (origin, direction) = camera.ray(f64::from(pixel % 40) + 0.5, f64::from(pixel / 40) + 0.5);
            let [(a, a_opacity), (b, b_opacity)] = [&field, &simple].map(|field| field.render_ray(origin, direction));
            worst = worst.max((a - b).abs().max_element()).max((a_opacity - b_opacity).abs());
        }
        assert!(worst < 0.25, "{worst}");
        // What differs between directions is less.
        let spread = |field: &PlenOctree| {
            let (mut sum, mut count) = (0.0, 0);
            for leaf in (0..field.leaves() as u32).step_by(7).filter(|leaf| field.densities()[*leaf as usize] > 30.0) {
                sum += (field.radiance(leaf, DVec3::X) - field.radiance(leaf, DVec3::NEG_X)).abs().element_sum();
                count += 1;
            }
            sum / f64::from(count)
        };
        assert!(spread(&simple) < 0.9 * spread(&field), "{} {}", spread(&simple), spread(&field));
        // Neighbors are more alike.
        let grain = |field: &PlenOctree| {
            let thick = (0..field.leaves() as u32).filter(|leaf| field.densities()[*leaf as usize] > 30.0);
            let colors: Vec<_> = thick.map(|leaf| field.radiance(leaf, DVec3::Z)).collect();
            let sum: f64 = colors.windows(2).map(|pair| (pair[0] - pair[1]).abs().element_sum()).sum();
            sum / colors.len() as f64
        };
        assert!(grain(&simple) < 0.8 * grain(&field), "{} {}", grain(&simple), grain(&field));
    }

    /// Settings out of range are named at once, and what is stopped ends at once.
    #[test]
    fn wrong_settings_are_errors_and_stopping_ends() {
        let settings = BakeSettings { depth: 6, basis: Basis::Sh1, ..Default::default() };
        let field = bake(&settings, |at| if at.length() < 0.5 { 60.0 } else { 0.0 }, |_| |_| DVec3::splat(0.5));
        let field = field.unwrap();
        let default = SimplifySettings::default;
        for (settings, name) in [
            (SimplifySettings { effort: 0.0, ..default() }, "effort"),
            (SimplifySettings { effort: f64::NAN, ..default() }, "effort"),
            (SimplifySettings { smoothness: -1.0, ..default() }, "smoothness"),
            (SimplifySettings { smoothness: f32::INFINITY, ..default() }, "smoothness"),
            (SimplifySettings { evenness: f32::NAN, ..default() }, "evenness"),
        ] {
            let error = simplify(&field, &settings, &FitProgress::default()).unwrap_err();
            assert!(error.to_string().starts_with(name), "{error}");
        }
        let progress = FitProgress::default();
        progress.stop();
        let same = simplify(&field, &default(), &progress).unwrap();
        assert_eq!((same.densities(), progress.status().stage.as_str()), (field.densities(), "drawing"));
    }

    /// What is recorded is that of the field before it was simplified, also once it is packed.
    #[test]
    fn recorded_histograms_stay() {
        let settings = BakeSettings { depth: 6, basis: Basis::Sh1, ..Default::default() };
        let field =
            bake(&settings, |at| if at.length() < 0.5 { 60.0 } else { 0.0 }, |at| move |_| 0.5 + 0.3 * at).unwrap();
        let field = field.recording_histograms(&Progress::default()).unwrap();
        let settings = SimplifySettings { effort: 0.02, ..Default::default() };
        let simple = simplify(&field, &settings, &FitProgress::default()).unwrap();
        let settings = PackSettings { record_histograms: true, rows: 16, ..Default::default() };
        let packed = Packed::new(&simple, &settings, &Progress::default()).unwrap();
        let of = |field: &PlenOctree| field.histograms(&SamplingSettings::default()).unwrap();
        assert_eq!(of(&simple), of(&field));
        assert_eq!(of(packed.field()), of(&field));
    }
}
