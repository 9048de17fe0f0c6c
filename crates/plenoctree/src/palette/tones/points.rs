//! The colors of a field in tone space, in which tones are judged by distance.

use std::collections::{BTreeMap, HashSet};

use glam::{DVec3, IVec3};
use rayon::prelude::*;

use crate::{
    palette::{
        colors::Palette,
        errors::{ColorErrors, ShownColors},
        oklab::{from_oklab, oklab},
        space,
    },
    sampling::{Bins, Canceled, Progress, View},
};

/// A few similar colors of a field, merged.
#[derive(Clone, Copy, Debug)]
pub(in crate::palette) struct Point {
    /// The mean in tone space.
    pub place: DVec3,
    /// The mean in Oklab.
    pub oklab: DVec3,
    /// Share of the visible weight.
    pub weight: f64,
    /// Share of the weight that the fit uses: rare colors count more than their share.
    pub salient: f64,
}

/// Number of points beyond which colors are not told apart better, because it would take too long.
const MOST: usize = 3000;
/// The side of the first cells in which colors are merged, if there are more.
const CELL: f64 = 0.01;
/// The side of the cells beside which colors of haze are near those of surfaces.
const HAZE: f64 = 0.1;
/// The distance within which colors count as similar, for their salience.
const SIMILAR: f64 = 0.06;
/// The weight of similar colors together counts like their share to this power.
const SALIENCE: f64 = 0.75;
/// The share of similar colors below which they count in proportion to it, so that specks do not become tones.
const SPECK: f64 = 1e-3;

/// Returns the colors of what is seen in views, each as often as it is seen. Where there is no surface, as in glass,
/// colors only count if none of a surface is near, because the haze around surfaces would move their tones.
pub(in crate::palette) fn seen_colors(views: &[View]) -> Vec<(DVec3, f64)> {
    let cell = |color: DVec3| (space::tone_space(color) / HAZE).round().as_ivec3();
    let of_surfaces = |view: &View| view.colors().filter(|seen| seen.1).map(|seen| cell(seen.0)).collect::<Vec<_>>();
    let cells: HashSet<IVec3> = views.par_iter().flat_map_iter(of_surfaces).collect();
    let beside = |cell: IVec3| (0..27).map(move |i| cell + IVec3::new(i / 9, i / 3 % 3, i % 3) - 1);
    let near: HashSet<IVec3> = cells.into_iter().flat_map(beside).collect();
    let seen = views.iter().flat_map(View::colors);
    let seen = seen.filter(|(color, is_surface)| *is_surface || !near.contains(&cell(*color)));
    seen.map(|(color, _)| (color.clamp(DVec3::ZERO, DVec3::ONE), 1.0)).collect()
}

/// Returns the colors of a histogram that have weight.
pub(in crate::palette) fn binned_colors(bins: &Bins) -> Vec<(DVec3, f64)> {
    let seen = bins.weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0);
    seen.map(|(bin, weight)| (bins.center(bin).into(), *weight)).collect()
}

/// Returns colors in encoded sRGB and their weights, merged in cells.
pub(in crate::palette) fn points(colors: &[(DVec3, f64)], progress: &Progress) -> Result<Vec<Point>, Canceled> {
    // The sum of the heaviest weights might be infinite, but not that of their shares of the largest.
    let most = colors.iter().map(|(_, weight)| *weight).fold(0.0, f64::max);
    let total: f64 = colors.iter().map(|(_, weight)| weight / most).sum();
    let color = |&(color, weight): &(DVec3, f64)| {
        progress.check()?;
        Ok((oklab(color), weight / most / total))
    };
    let all: Vec<(DVec3, f64)> = colors.par_iter().map(color).collect::<Result<_, _>>()?;
    let mut cell = CELL;
    let mut points = match all.len() {
        ..=MOST => all.iter().copied().map(point).collect(),
        _ => merge(&all, cell, progress)?,
    };
    while points.len() > MOST {
        cell *= 1.25;
        points = merge(&all, cell, progress)?;
    }
    weigh(&mut points, progress)?;
    Ok(points)
}

/// Returns how far points are from the tones that show them, if rare colors count more than their share: the larger of
/// the root mean square and that of hues.
pub(in crate::palette) fn salient_error(points: &[Point], palette: &Palette) -> f64 {
    let shown = ShownColors::new(palette, 1);
    let errors = ColorErrors::of(points.iter().filter_map(|point| {
        let color = from_oklab(point.oklab);
        Some((point.salient, color, shown.nearest(color)?.0))
    }));
    errors.rmse.max(errors.hue)
}

/// Merges the colors in every cell of tone space into their mean.
fn merge(colors: &[(DVec3, f64)], side: f64, progress: &Progress) -> Result<Vec<Point>, Canceled> {
    let mut cells = BTreeMap::<[i32; 3], (DVec3, f64)>::new();
    for &(oklab, weight) in colors {
        progress.check()?;
        let cell = (space::from_oklab(oklab) / side).round().as_ivec3().to_array();
        let (sum, total) = cells.entry(cell).or_default();
        *sum += weight * oklab;
        *total += weight;
    }
    // The weights of the faintest cells may vanish.
    let cells = cells.into_values().filter(|(_, weight)| *weight > 0.0);
    Ok(cells.map(|(sum, weight)| point((sum / weight, weight))).collect())
}

/// Returns the point of a color in Oklab with a weight.
fn point((oklab, weight): (DVec3, f64)) -> Point {
    Point { place: space::from_oklab(oklab), oklab, weight, salient: weight }
}

/// Finds how much every point counts.
fn weigh(points: &mut [Point], progress: &Progress) -> Result<(), Canceled> {
    let similar = |a: &Point| {
        progress.check()?;
        let kernel = |b: &Point| b.weight * (-a.place.distance_squared(b.place) / (2.0 * SIMILAR * SIMILAR)).exp();
        Ok(a.weight * points.iter().map(kernel).sum::<f64>().max(SPECK).powf(SALIENCE - 1.0))
    };
    let salient: Vec<f64> = points.par_iter().map(similar).collect::<Result<_, _>>()?;
    let total: f64 = salient.iter().sum();
    points.iter_mut().zip(salient).for_each(|(point, salient)| point.salient = salient / total);
    Ok(())
}
