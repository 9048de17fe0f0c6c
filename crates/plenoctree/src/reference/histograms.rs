//! Visibility-weighted radiance samples: section 3 of the method, steps 1 to 5 (equation 8 of the paper).

use std::{f64::consts::TAU, ops::ControlFlow};

use glam::DVec3;

use crate::{
    field::{LeafCell, PlenOctree, UpAxis},
    sampling::{Bins, Histograms, InvalidSetting, ObserverRegion, SamplingSettings},
};

/// Samples a whole field, sample by sample, in float64 and on one core.
///
/// Samples every leaf, regardless of [`SamplingSettings::sample_fraction`].
///
/// # Errors
///
/// Returns an error if a setting is out of range.
pub fn sample_histograms(field: &PlenOctree, settings: &SamplingSettings) -> Result<Histograms, InvalidSetting> {
    settings.validate()?;
    let bins = [settings.fine_bins, settings.coarse_bins];
    let mut weights = bins.map(|bins| vec![0.0; bins.pow(3)]);
    let cells = f64::from(1u32 << field.depth());
    let directions = observers(field.up(), settings);
    let at_entry = is_solid(field, &directions, settings.stop_transmittance);
    for cell in field.leaf_cells() {
        let center = field.frame().to_world((cell.corner.as_dvec3() + 0.5 * f64::from(cell.size)) / cells);
        let density = f64::from(field.densities()[cell.leaf as usize]);
        for rays in &directions {
            // The rays of a direction cell make one antialiased sample: step 4. Averaging differences from the first
            // color keeps a color that is the same in all directions exact, even on the border of a bin.
            let first = field.radiance(cell.leaf, -rays[0]);
            let (mut weight, mut color) = (0.0, DVec3::ZERO);
            for &observer in rays {
                let own = density * half_path(field, cell, observer);
                let visibility = density
                    * if at_entry {
                        let entry =
                            transmittance(field, center, observer, Some(cell.leaf), settings.stop_transmittance);
                        entry * mean_transmittance(2.0 * own)
                    } else {
                        transmittance(field, center, observer, None, settings.stop_transmittance)
                    };
                weight += visibility;
                color += visibility * (field.radiance(cell.leaf, -observer) - first);
            }
            if weight > 0.0 {
                for (bins, weights) in bins.iter().zip(&mut weights) {
                    weights[bin(first + color / weight, *bins)] += weight / rays.len() as f64;
                }
            }
        }
    }
    let samples = field.leaves() * directions.len();
    let [fine, coarse] = weights;
    let bins = |per_channel, weights| Bins { per_channel, weights };
    let (fine, coarse) = (bins(settings.fine_bins, fine), bins(settings.coarse_bins, coarse));
    Ok(Histograms { fine, coarse, samples: samples as u64 })
}

/// Returns the index of a color's bin: step 5.
fn bin(color: DVec3, bins: usize) -> usize {
    let [r, g, b] = color.to_array().map(|c| (c.clamp(0.0, 0.999) * bins as f64).floor() as usize);
    (r * bins + g) * bins + b
}

/// Returns the unit vectors to the observers, one inner list per direction cell: step 2.
fn observers(up: UpAxis, settings: &SamplingSettings) -> Vec<Vec<DVec3>> {
    let n = settings.directions;
    let (columns, rows, lowest) = match settings.observers {
        ObserverRegion::UpperHemisphere => (4 * n, n, 0.0),
        ObserverRegion::Sphere => (4 * n, 2 * n, -1.0),
    };
    let m = settings.multisamples;
    let mut cells = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let mut rays = Vec::new();
            for i in 0..m {
                for j in 0..m {
                    let u = ((row * m + i) as f64 + 0.5) / (rows * m) as f64;
                    let v = ((column * m + j) as f64 + 0.5) / (columns * m) as f64;
                    let cos_theta = lowest + (1.0 - lowest) * u;
                    let sin_theta = (1.0 - cos_theta * cos_theta).sqrt();
                    let phi = TAU * v;
                    let z_up = DVec3::new(sin_theta * phi.cos(), sin_theta * phi.sin(), cos_theta);
                    rays.push(match up {
                        UpAxis::Z => z_up,
                        UpAxis::Y => DVec3::new(z_up.x, z_up.z, -z_up.y),
                    });
                }
            }
            cells.push(rays);
        }
    }
    cells
}

/// Returns whether more than half of what observers see is in leaves that hide their own centers, so that leaves are
/// sampled where rays enter them: step 3.
fn is_solid(field: &PlenOctree, directions: &[Vec<DVec3>], stop: f64) -> bool {
    let cells = f64::from(1u32 << field.depth());
    let least = stop.max((-87.0f64).exp());
    let (mut seen, mut left_out) = (0.0, 0.0);
    for cell in field.leaf_cells() {
        let center = field.frame().to_world((cell.corner.as_dvec3() + 0.5 * f64::from(cell.size)) / cells);
        for &observer in directions.iter().filter_map(|rays| rays.first()) {
            let own = f64::from(field.densities()[cell.leaf as usize]) * half_path(field, cell, observer);
            let entry = transmittance(field, center, observer, Some(cell.leaf), least);
            let light = f64::from(cell.size).powi(2) * entry * (1.0 - (-2.0 * own).exp());
            seen += light;
            if (-own).exp() < least {
                left_out += light;
            }
        }
    }
    left_out > 0.5 * seen
}

/// Returns the length of the path from the center of a leaf to where it leaves the leaf.
fn half_path(field: &PlenOctree, cell: LeafCell, toward: DVec3) -> f64 {
    let half = 0.5 * f64::from(cell.size) / f64::from(1u32 << field.depth()) / field.frame().scale;
    (half / toward.abs()).min_element()
}

/// Returns the mean transmittance along a path of this optical depth.
fn mean_transmittance(depth: f64) -> f64 {
    if depth > 0.0 { -(-depth).exp_m1() / depth } else { 1.0 }
}

/// Returns the transmittance from `point` to the edge of the field, or 0 if it is less than `stop`. The leaf `except`
/// counts as empty.
fn transmittance(field: &PlenOctree, point: DVec3, toward: DVec3, except: Option<u32>, stop: f64) -> f64 {
    let mut depth = 0.0_f64;
    field.march(point, toward, |crossing| {
        if Some(crossing.leaf) != except {
            depth += f64::from(field.densities()[crossing.leaf as usize]) * crossing.length;
        }
        if (-depth).exp() < stop { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    let transmittance = (-depth).exp();
    if transmittance < stop { 0.0 } else { transmittance }
}
