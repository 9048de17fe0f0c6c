//! Directions from which leaves are seen: section 3 of the method, step 2.

use std::f64::consts::TAU;

use glam::DVec3;

use crate::field::UpAxis;
use crate::histograms::{ObserverRegion, SamplingSettings};

/// Returns unit vectors from a leaf to the observers, in the field's frame: the rays of every direction cell.
pub(super) fn observers(up: UpAxis, settings: &SamplingSettings) -> Vec<Vec<DVec3>> {
    let (n, m) = (settings.directions, settings.multisamples);
    // cos theta ranges from `lowest` to 1.
    let (rows, lowest) = match settings.observers {
        ObserverRegion::UpperHemisphere => (n, 0.0),
        ObserverRegion::Sphere => (2 * n, -1.0),
    };
    let columns = 4 * n;
    let ray = |row: usize, column: usize| {
        let height = lowest + (1.0 - lowest) * (row as f64 + 0.5) / (rows * m) as f64;
        let (sin, cos) = (TAU * (column as f64 + 0.5) / (columns * m) as f64).sin_cos();
        let radius = (1.0 - height * height).sqrt();
        upright(up, DVec3::new(radius * cos, radius * sin, height))
    };
    let cell = |cell: usize| {
        let (row, column) = (cell / columns, cell % columns);
        (0..m * m).map(|sample| ray(row * m + sample / m, column * m + sample % m)).collect()
    };
    (0..rows * columns).map(cell).collect()
}

/// Returns a vector given with z up in the field's frame.
pub(super) fn upright(up: UpAxis, z_up: DVec3) -> DVec3 {
    match up {
        UpAxis::Z => z_up,
        UpAxis::Y => DVec3::new(z_up.x, z_up.z, -z_up.y),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Equal cells in (cos theta, phi) cover equal solid angles, so the mean of all directions is that of the
    /// hemisphere or of the sphere.
    #[test]
    fn directions_cover_the_sphere_evenly() {
        for (observers_from, mean) in [(ObserverRegion::UpperHemisphere, 0.5), (ObserverRegion::Sphere, 0.0)] {
            for n in 1..4 {
                let settings = SamplingSettings { observers: observers_from, directions: n, ..Default::default() };
                let cells = observers(UpAxis::Z, &settings);
                assert_eq!(cells.len(), settings.direction_cells());
                let rays: Vec<DVec3> = cells.into_iter().flatten().collect();
                assert_eq!(rays.len(), 4 * settings.direction_cells());
                assert!(rays.iter().all(|ray| ray.is_normalized()));
                let sum: DVec3 = rays.iter().sum();
                assert!((sum / rays.len() as f64 - DVec3::Z * mean).length() < 1e-12, "{sum}");
            }
        }
    }

    /// The first cell of the paper's grid: u in [0, 1/2], v in [0, 1/8], two by two.
    #[test]
    fn the_first_cell_is_that_of_the_method() {
        let cells = observers(UpAxis::Z, &SamplingSettings::default());
        for (ray, (u, v)) in cells[0].iter().zip([(0.125, 1.0), (0.125, 3.0), (0.375, 1.0), (0.375, 3.0)]) {
            let phi = TAU * v / 32.0;
            assert!((ray.z - u).abs() < 1e-15);
            assert!((ray.y.atan2(ray.x) - phi).abs() < 1e-15);
        }
    }

    #[test]
    fn the_hemisphere_is_above_the_horizon() {
        let cells = observers(UpAxis::Y, &SamplingSettings::default());
        assert!(cells.iter().flatten().all(|ray| ray.y > 0.0));
    }
}
