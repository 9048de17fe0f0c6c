//! The apparent areas at which Gaussians have their opacity, chosen for those who see them.
//!
//! A splat is equally opaque from every side, but the optical depth of an ellipsoid is larger where its apparent area
//! is small. Most Gaussians are flat, and seen from few sides: those from which they are not hidden.

use std::sync::atomic::{AtomicU32, Ordering};

use glam::{DMat3, DVec3, Vec3};
use plenoctree::camera::PinholeCamera;
use rayon::prelude::*;

use super::{
    gaussian::{Shown, widths},
    optics::MOST_OPACITY,
};
use crate::splat::{
    render::draw,
    splats::{Gaussian, Splats},
};

/// Areas of a Gaussian that are told apart, from the smallest to the largest.
const AREAS: usize = 16;
/// The ratio of the largest area to the smallest below which they are not told apart.
const ALIKE: f64 = 1.05;
/// The weight of the mean area of all directions, in pixels of the views.
const USUAL: f64 = 0.5;
/// The part of a Gaussian's opacity that is compared: about its mean where it is seen.
const COMPARED: f64 = 0.75;
/// The most units of weight in a pixel. Weights are whole numbers so that the order of views does not matter.
const UNITS: f64 = 256.0;

/// Returns how each Gaussian shows in cells of this `width`, after a `blur` in cells. The squared error of its opacity
/// is the least, over all pixels of the views that show it, by how much they do. Without views, it is that of the mean
/// of all directions. The result is the same on any number of threads.
pub fn areas(splats: &Splats, views: &[PinholeCamera], width: f64, blur: f64) -> Vec<Shown> {
    let mean = |gaussian: &Gaussian| Shown::mean(splats, gaussian, width, blur);
    if views.is_empty() {
        return splats.gaussians().par_iter().map(mean).collect();
    }
    let pixels: f64 = views.iter().map(|view| f64::from(view.width) * f64::from(view.height)).sum();
    let units = UNITS.min(f64::from(u32::MAX) / pixels.max(1.0));
    let ranges: Vec<Range> =
        splats.gaussians().par_iter().map(|gaussian| Range::new(widths(gaussian, width, blur))).collect();
    let weights: Vec<AtomicU32> = (0..AREAS * splats.len()).map(|_| AtomicU32::new(0)).collect();
    views.par_iter().for_each(|view| {
        let show = |index: u32, sum: f32| {
            let sum = (f64::from(sum) * units).round() as u32;
            if sum == 0 {
                return;
            }
            let index = index as usize;
            let gaussian = &splats.gaussians()[index];
            let direction = (gaussian.position.as_dvec3() - view.position).normalize();
            let place = ranges[index].place(ranges[index].apparent(gaussian, direction));
            weights[index * AREAS + place].fetch_add(sum, Ordering::Relaxed);
        };
        draw(splats, view, |_, _| Vec3::ZERO, show);
    });
    let best = |((gaussian, range), weights): ((&Gaussian, &Range), &[AtomicU32])| {
        let usual = mean(gaussian);
        let mut weights: [f64; AREAS] =
            std::array::from_fn(|area| f64::from(weights[area].load(Ordering::Relaxed)) / units);
        if range.steps.is_none() || weights.iter().all(|weight| *weight == 0.0) {
            return usual;
        }
        weights[range.place(usual.area)] += USUAL;
        let opacity = COMPARED * usual.opacity.min(MOST_OPACITY);
        Shown { area: range.area(least(&weights, opacity, range.ratio())), ..usual }
    };
    splats.gaussians().par_iter().zip(&ranges).zip(weights.par_chunks(AREAS)).map(best).collect()
}

/// The apparent areas of a Gaussian.
struct Range {
    /// Those along its axes.
    faces: DVec3,
    smallest: f64,
    /// Steps per factor of e, unless all are alike.
    steps: Option<f64>,
}

impl Range {
    /// Returns those of a Gaussian with these half-widths.
    fn new(widths: DVec3) -> Self {
        let faces = DVec3::new(widths.y * widths.z, widths.x * widths.z, widths.x * widths.y);
        let (smallest, ratio) = (faces.min_element(), faces.max_element() / faces.min_element());
        Self { faces, smallest, steps: (ratio > ALIKE).then(|| (AREAS - 1) as f64 / ratio.ln()) }
    }

    /// Returns the area of this Gaussian in a direction.
    fn apparent(&self, gaussian: &Gaussian, direction: DVec3) -> f64 {
        let axes = DMat3::from_quat(gaussian.rotation.as_dquat().normalize());
        (axes.transpose() * direction * self.faces).length()
    }

    /// Returns the number of the area that is most like this one.
    fn place(&self, area: f64) -> usize {
        let Some(steps) = self.steps else { return 0 };
        ((area / self.smallest).ln() * steps).round().clamp(0.0, (AREAS - 1) as f64) as usize
    }

    /// Returns the area of a number, which need not be whole.
    fn area(&self, place: f64) -> f64 {
        self.steps.map_or(self.smallest, |steps| self.smallest * (place / steps).exp())
    }

    /// Returns the ratio of neighbors.
    fn ratio(&self) -> f64 {
        self.area(1.0) / self.smallest
    }
}

/// Returns the place of the area for which the squared error of this opacity is least, by the weights of areas that
/// grow by `ratio`.
fn least(weights: &[f64; AREAS], opacity: f64, ratio: f64) -> f64 {
    // The squared error where an area has the optical depth of one that is so many places after it.
    let last = AREAS as i32 - 1;
    let errors: [f64; 2 * AREAS - 1] = std::array::from_fn(|shift| {
        let found = 1.0 - (1.0 - opacity).powf(ratio.powi(shift as i32 - last));
        (found - opacity).powi(2)
    });
    let error = |place: usize| -> f64 {
        weights.iter().enumerate().map(|(area, weight)| weight * errors[place + AREAS - 1 - area]).sum()
    };
    let all: [f64; AREAS] = std::array::from_fn(error);
    let best = (0..AREAS).min_by(|a, b| all[*a].total_cmp(&all[*b])).unwrap_or_default();
    if best == 0 || best == AREAS - 1 {
        return best as f64;
    }
    // The lowest point of the parabola through it and its neighbors.
    let [before, lowest, after] = [all[best - 1], all[best], all[best + 1]];
    let bend = before - 2.0 * lowest + after;
    best as f64 + if bend > 0.0 { 0.5 * (before - after) / bend } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// No area that is told apart has a smaller error than the chosen one, apart from the parabola's error.
        #[test]
        fn chosen_areas_have_the_least_error(
            weights in prop::array::uniform16(prop_oneof![Just(0.0), 0.0f64..100.0]),
            opacity in 0.01f64..COMPARED,
            ratio in 1.01f64..1.4,
        ) {
            let found = least(&weights, opacity, ratio);
            let error = |place: f64| -> f64 {
                let of = |(area, weight): (usize, &f64)| {
                    let seen = 1.0 - ((1.0 - opacity).ln() * ratio.powf(place - area as f64)).exp();
                    weight * (seen - opacity).powi(2)
                };
                weights.iter().enumerate().map(of).sum()
            };
            let lowest = (0..AREAS).map(|place| error(place as f64)).fold(f64::INFINITY, f64::min);
            let rounding = 3e-4 * weights.iter().sum::<f64>();
            prop_assert!(error(found) <= lowest + rounding, "{found}: {} {lowest}", error(found));
        }
    }
}
