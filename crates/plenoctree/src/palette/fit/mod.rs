//! Palettes that are fitted to their own labels: section 3 of the method, step 10.

mod labels;
mod points;
mod search;

use super::{colors::Palette, extract::order, kmeans::Clusters};
use crate::sampling::Bins;
use points::Points;

/// The colors of a histogram, to which palettes are fitted.
pub(super) struct Cloud {
    bins: Clusters,
    per_channel: usize,
}

/// Numbers of cells per channel of the lattices in which colors are merged to search with, and to fit to.
const FEW: [usize; 2] = [8, 16];
const MANY: [usize; 1] = [16];

/// Number of points per palette color for which a coarse lattice is fine enough.
const ENOUGH: usize = 12;

impl Cloud {
    /// Returns the colors of a histogram, or `None` if it has no weight.
    pub fn new(bins: &Bins) -> Option<Self> {
        // The sum of the heaviest weights might be infinite, but not that of their shares of the largest.
        let most = bins.weights.iter().copied().fold(0.0, f64::max);
        let total: f64 = bins.weights.iter().map(|weight| weight / most).sum();
        let seen = bins.weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0);
        let (centers, weights): (Vec<_>, Vec<_>) =
            seen.map(|(bin, weight)| (bins.center(bin), weight / most / total)).unzip();
        let per_channel = bins.per_channel;
        (!centers.is_empty()).then_some(Self { bins: Clusters { centers, weights }, per_channel })
    }

    /// Returns the palette of at most `colors` colors whose labels are nearest to the colors of the cloud, with its
    /// heaviest color first. It has fewer colors if the cloud has fewer, or if fewer fit as well.
    pub fn fit(&self, colors: usize, blend_steps: u32) -> Palette {
        let Clusters { centers, .. } = &self.bins;
        let found = if centers.len() <= colors {
            centers.clone()
        } else {
            let [few, many] = [&FEW[..], &MANY].map(|lattices| self.merged(lattices, ENOUGH * colors));
            search::search(&few, &many, colors, blend_steps)
        };
        order(found, &self.bins)
    }

    /// Returns the colors, merged in the first of some lattices that keeps at least `least` points, or not merged if none
    /// does.
    fn merged(&self, lattices: &[usize], least: usize) -> Points {
        let Clusters { centers, weights } = &self.bins;
        let coarse = lattices.iter().filter(|lattice| **lattice < self.per_channel);
        let mut coarse = coarse.map(|&lattice| Points::new(centers, weights, lattice));
        let enough = coarse.find(|points| points.all.len() >= least);
        enough.unwrap_or_else(|| Points::new(centers, weights, self.per_channel))
    }
}
