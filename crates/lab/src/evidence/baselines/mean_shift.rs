//! Mean shift (Cheng 1995), which the paper names as an alternative to k-means.

use glam::{DVec3, IVec3};
use plenoctree::{
    palette::{InvalidPalette, Palette, simplify_hull},
    sampling::Histograms,
};
use rayon::prelude::*;

use super::colors::{WeightedColors, bin_center};

/// The standard deviation of the Gaussian kernel, in encoded sRGB: one bin and a half of the fine histogram.
pub const BANDWIDTH: f64 = 1.5 / 32.0;
/// The number of standard deviations at which the kernel ends.
const REACH: f64 = 3.0;
/// A shift that ends the search.
const STILL: f64 = 1e-5;
/// The largest number of shifts.
const SHIFTS: usize = 500;

/// A maximum of the density of colors.
#[derive(Clone, Copy, Debug)]
pub struct Mode {
    /// Its color.
    pub color: DVec3,
    /// The share of the weight that climbs to it.
    pub weight: f64,
}

/// Returns the simplified hull of the modes of the weighted fine histogram, and the number of modes.
///
/// As for k-means, only modes with more than `threshold` of the weight count, or the heaviest if there is none.
pub fn mean_shift(
    histograms: &Histograms,
    threshold: f64,
    max_colors: usize,
) -> Result<(Palette, usize), InvalidPalette> {
    let modes = modes(histograms.fine(), BANDWIDTH);
    let mut centers: Vec<[f64; 3]> =
        modes.iter().filter(|mode| mode.weight > threshold).map(|mode| mode.color.into()).collect();
    if centers.is_empty() {
        centers.extend(modes.first().map(|mode| mode.color.to_array()));
    }
    let corners = simplify_hull(&centers, max_colors)?.colors;
    Ok((WeightedColors::of_histograms(histograms).palette(corners), centers.len()))
}

/// Returns the modes of a histogram, heaviest first. Every bin with weight climbs to one of them.
fn modes(bins: &[f64], bandwidth: f64) -> Vec<Mode> {
    let total: f64 = bins.iter().sum();
    let mut filled: Vec<usize> = (0..bins.len()).filter(|&bin| bins[bin] > 0.0).collect();
    filled.sort_by(|&a, &b| bins[b].total_cmp(&bins[a]));
    let ends: Vec<DVec3> =
        filled.par_iter().map(|&bin| climb(bins, DVec3::from(bin_center(bin, bins.len())), bandwidth)).collect();
    // Searches for the same mode stop close to it. Modes closer than the kernel's width cannot be told apart.
    let mut modes: Vec<Mode> = Vec::new();
    for (&bin, end) in filled.iter().zip(ends) {
        let weight = bins[bin] / total;
        match modes.iter_mut().find(|mode| mode.color.distance(end) < 0.5 * bandwidth) {
            Some(mode) => mode.weight += weight,
            None => modes.push(Mode { color: end, weight }),
        }
    }
    modes.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    modes
}

/// Follows the mean of the colors around a color until it no longer shifts.
fn climb(bins: &[f64], mut color: DVec3, bandwidth: f64) -> DVec3 {
    let side = (bins.len() as f64).cbrt().round();
    let last = IVec3::splat(side as i32 - 1);
    let reach = (REACH * bandwidth * side).ceil() as i32;
    for _ in 0..SHIFTS {
        let middle = (color * side).floor().as_ivec3();
        let (low, high) = ((middle - reach).max(IVec3::ZERO), (middle + reach).min(last));
        let (mut sum, mut total) = (DVec3::ZERO, 0.0);
        for r in low.x..=high.x {
            for g in low.y..=high.y {
                let row = ((r * side as i32 + g) * side as i32) as usize;
                for b in low.z..=high.z {
                    let weight = bins[row + b as usize];
                    if weight > 0.0 {
                        let center = (IVec3::new(r, g, b).as_dvec3() + 0.5) / side;
                        let kernel = (-0.5 * center.distance_squared(color) / (bandwidth * bandwidth)).exp();
                        sum += weight * kernel * center;
                        total += weight * kernel;
                    }
                }
            }
        }
        if total <= 0.0 {
            break;
        }
        let next = sum / total;
        let shift = next.distance(color);
        color = next;
        if shift < STILL {
            break;
        }
    }
    color
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three Gaussians of known weights in a histogram: the modes are their centers, and get their weights.
    #[test]
    fn the_modes_of_a_mixture_are_found() {
        let mixture = [([0.25, 0.3, 0.35], 0.5), ([0.7, 0.2, 0.6], 0.3), ([0.55, 0.8, 0.15], 0.2)];
        let bins: Vec<f64> = (0..32usize.pow(3))
            .map(|bin| {
                let center = DVec3::from(bin_center(bin, 32usize.pow(3)));
                let part = |(mean, weight): &([f64; 3], f64)| {
                    weight * (-0.5 * center.distance_squared(DVec3::from(*mean)) / 0.06f64.powi(2)).exp()
                };
                mixture.iter().map(part).sum()
            })
            .collect();
        let modes = modes(&bins, BANDWIDTH);
        assert_eq!(modes.iter().filter(|mode| mode.weight > 8e-3).count(), 3, "{modes:?}");
        for (mode, (mean, weight)) in modes.iter().zip(mixture) {
            assert!(mode.color.distance(DVec3::from(mean)) < 0.01, "{mode:?}, expected {mean:?}");
            assert!((mode.weight - weight).abs() < 0.01, "{mode:?}, expected {weight}");
        }
    }

    /// A single color is its own mode.
    #[test]
    fn one_color_is_one_mode() {
        let mut fine = vec![0.0; 32usize.pow(3)];
        fine[12345] = 2.0;
        let coarse = {
            let mut bins = vec![0.0; 512];
            bins[0] = 2.0;
            bins
        };
        let histograms = Histograms::new(32, fine, 8, coarse, 1).unwrap();
        let (palette, modes) = mean_shift(&histograms, 8e-3, 6).unwrap();
        assert_eq!((palette.colors.len(), modes), (1, 1));
        assert!(DVec3::from(palette.colors[0]).distance(DVec3::from(bin_center(12345, 32usize.pow(3)))) < 1e-12);
    }
}
