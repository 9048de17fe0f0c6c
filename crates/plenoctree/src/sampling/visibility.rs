//! Measures how visible each leaf is from all around.

use glam::DVec3;
use half::f16;
use rayon::prelude::*;

use super::{
    blocks::{Blocks, ROWS},
    directions::upright,
    march::optical_depth,
    path::SIDE,
    progress::{Canceled, Progress},
    sample_point::SamplePoint,
    sampler::{BlockLeaf, Sampler, Unit},
};
use crate::field::{Activation, PlenOctree};
use crate::histograms::SamplingSettings;
use crate::sphere::spiral;

/// Numbers of directions, spread evenly. The second ones are for leaves that are hidden in all of the first ones: they
/// may be at the bottom of a hole.
const DIRECTIONS: [u32; 2] = [72, 288];
/// Transmittance below which a leaf counts as hidden.
const HIDDEN: f64 = 1e-3;
/// Opacity that a leaf must add to a ray so that its color counts.
const FAINT: f64 = 1e-4;
/// Transmittance that leaves have at least if they may also be seen from inside: an observer there sees them from some
/// of the directions in which others hide them from outside.
const INSIDE: f64 = 0.5;
/// The least slope of the activation that counts for colors, relative to the steepest one. Without it, the colors of
/// saturated leaves would not matter at all, and any other would replace them.
const LEAST_SLOPE: f64 = 0.08;

/// The visibility of a leaf to observers in all directions.
///
/// An observer's ray through the leaf's center reaches it with transmittance `T`. The leaf then adds `T a` to the ray's
/// opacity, where `a` is its own opacity. Squares are averaged over the directions, and weighted by the leaf's area.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Seen {
    /// The largest `T a`.
    pub most: f32,
    /// Mean of `T^2`: a pixel's squared error per squared error of opacity.
    pub depth: f32,
    /// Mean of `(T a)^2 s^2` for each channel, where `s` is the [`slope`] of the activation: a pixel's squared error
    /// per squared error of the channel's sum of harmonics.
    pub channels: [f32; 3],
    /// The same for errors that may be large: `s` is at least [`LEAST_SLOPE`].
    pub colors: [f32; 3],
    /// The contribution of each direction to the sum of `channels`: of the first ones, or zeros for them and then of
    /// the second ones. Empty if the leaf is not visible.
    pub views: Vec<f16>,
}

impl Seen {
    /// Returns the sum of `channels`.
    pub fn total(&self) -> f32 {
        self.channels.iter().sum()
    }
}

/// The visibility of all leaves.
pub(crate) struct Visibility {
    pub leaves: Vec<Seen>,
    /// The values of the basis functions for the views in all directions, the first and the second ones.
    pub directions: Vec<[f32; 25]>,
}

/// Measures the visibility of each leaf, on all cores. The result does not depend on their number.
///
/// Views from below the horizon are weighted by `below`, except for [`Seen::most`]. If the field is also seen from
/// `inside`, no leaf is hidden.
pub(crate) fn visibility(
    field: &PlenOctree,
    below: f64,
    inside: bool,
    progress: &Progress,
) -> Result<Visibility, Canceled> {
    let least = if inside { INSIDE } else { 0.0 };
    let settings = SamplingSettings::default();
    // Leaves do not hide themselves.
    let mut sampler = Sampler::new(field, &settings, SamplePoint::Entry, Blocks::new(field, progress)?, progress)?;
    let mut hidden: Vec<_> = field.leaf_cells().collect();
    let mut leaves = vec![Seen::default(); hidden.len()];
    let mut directions = Vec::new();
    progress.begin(hidden.len());
    for count in DIRECTIONS {
        let observers: Vec<DVec3> = spiral(count, [1.0, -1.0]).map(|observer| upright(field.up(), observer)).collect();
        let counts: Vec<f64> = observers
            .iter()
            .map(|observer| if (field.up().to_y_up() * *observer).y < 0.0 { below } else { 1.0 })
            .collect();
        sampler = sampler.seen_from(vec![observers])?;
        let before = directions.len();
        let units = sampler.units(&hidden)?.into_par_iter();
        let seen: Vec<Vec<(usize, Seen)>> =
            units.map(|unit| of_unit(&sampler, &unit, before, &counts, least)).collect::<Result<_, _>>()?;
        seen.into_iter().flatten().for_each(|(leaf, seen)| leaves[leaf] = seen);
        hidden.retain(|cell| leaves[cell.leaf as usize].most == 0.0);
        directions.extend(sampler.cells.iter().flatten().map(|ray| ray.basis.map(|y| y as f32)));
    }
    Ok(Visibility { leaves, directions })
}

/// Returns the visibility of the leaves of a unit, in all directions but the first, `before` of them. `counts` are the
/// weights of the views in each direction, and `least` is the least transmittance.
fn of_unit(
    sampler: &Sampler,
    unit: &Unit,
    before: usize,
    counts: &[f64],
    least: f64,
) -> Result<Vec<(usize, Seen)>, Canceled> {
    sampler.progress.check()?;
    let field = sampler.field;
    let limit = -HIDDEN.ln();
    let rays = || sampler.cells.iter().flatten();
    let count = counts.iter().sum();
    let mut tallies;
    match unit {
        Unit::Block(unit) => {
            let tally = |leaf: &BlockLeaf| Tally::new(field, leaf.leaf, leaf.size, before);
            tallies = unit.leaves.iter().map(tally).collect::<Vec<_>>();
            let Some(blocks) = &sampler.blocks else { return Ok(Vec::new()) };
            let mut depths = [[0.0; SIDE]; ROWS];
            for (ray, count) in rays().zip(counts) {
                sampler.progress.check()?;
                sampler.march(blocks, unit, ray, limit, &mut depths);
                for (leaf, tally) in unit.leaves.iter().zip(&mut tallies) {
                    let transmittance = f64::from(-depths[leaf.row][leaf.lane]).exp().max(least);
                    tally.add(field, transmittance, ray.half(leaf.size), &ray.basis, *count);
                }
            }
        }
        Unit::Alone(leaf) => {
            let mut tally = Tally::new(field, leaf.leaf, leaf.size, before);
            for (ray, count) in rays().zip(counts) {
                sampler.progress.check()?;
                let depth = optical_depth(field, *leaf, ray.direction, SamplePoint::Entry, limit);
                tally.add(field, (-depth).exp().max(least), ray.half(leaf.size), &ray.basis, *count);
            }
            tallies = vec![tally];
        }
    }
    // Leaves that are hidden in all of the first directions are looked at again.
    let done = tallies.iter().filter(|tally| before > 0 || tally.most as f32 > 0.0).count();
    sampler.progress.advance(done);
    Ok(tallies.into_iter().map(|tally| (tally.leaf, tally.finish(count, field.activation()))).collect())
}

/// The sums for a leaf so far.
struct Tally {
    leaf: usize,
    density: f64,
    /// In finest cells.
    area: f64,
    most: f64,
    depth: f64,
    channels: [f64; 3],
    /// Of `(T a)^2`.
    whole: f64,
    /// The contribution of each direction to the sum of `channels`.
    views: Vec<f64>,
}

impl Tally {
    fn new(field: &PlenOctree, leaf: u32, size: u32, before: usize) -> Self {
        Self {
            leaf: leaf as usize,
            density: f64::from(field.densities()[leaf as usize]),
            area: f64::from(size).powi(2),
            most: 0.0,
            depth: 0.0,
            channels: [0.0; 3],
            whole: 0.0,
            views: vec![0.0; before],
        }
    }

    /// Adds an observer whose ray reaches the leaf with a `transmittance`, and the halves of whose path through the
    /// leaf are `half` long. `y` are the basis functions of the view, and `count` is its weight.
    fn add(&mut self, field: &PlenOctree, transmittance: f64, half: f64, y: &[f64; 25], count: f64) {
        self.views.push(0.0);
        if transmittance < HIDDEN {
            return;
        }
        let opacity = -(-2.0 * self.density * half).exp_m1();
        let weight = transmittance * opacity;
        self.most = self.most.max(weight);
        self.depth += count * transmittance * transmittance;
        if weight < FAINT {
            return;
        }
        self.whole += count * weight * weight;
        let sums = field.stored().sums(field.basis(), self.leaf, y);
        let squared = sums.map(|x| count * (weight * slope(field.activation(), x)).powi(2));
        for (total, squared) in self.channels.iter_mut().zip(squared) {
            *total += squared;
        }
        if let Some(view) = self.views.last_mut() {
            *view = squared.iter().sum();
        }
    }

    fn finish(self, directions: f64, activation: Activation) -> Seen {
        let steepest = slope(activation, 0.0);
        let mean = |sum: f64| (sum * self.area / directions) as f32;
        let total = self.views.iter().sum::<f64>();
        let views = if total > 0.0 { &self.views[..] } else { &[] };
        Seen {
            most: self.most as f32,
            depth: mean(self.depth),
            channels: self.channels.map(mean),
            colors: self.channels.map(|sum| mean(sum.max(self.whole * (LEAST_SLOPE * steepest).powi(2)))),
            views: views.iter().map(|view| f16::from_f64(view / total)).collect(),
        }
    }
}

/// Returns the change of radiance per change of the sum: the derivative of the activation, except for sums a little below
/// those that a ReLU cuts off, which errors may raise above them.
fn slope(activation: Activation, x: f64) -> f64 {
    match activation {
        Activation::Sigmoid => {
            let radiance = activation.apply(x);
            radiance * (1.0 - radiance)
        }
        // Falls from 1 at -0.5.
        Activation::ShiftedRelu => (2.0 * x + 2.0).clamp(0.0, 1.0),
        Activation::Identity => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        bake::{BakeSettings, bake},
        field::Basis,
    };

    /// A ball of dense cells shows only its surface. In haze, everything is visible.
    #[test]
    fn only_the_surface_of_a_dense_ball_is_seen() {
        let settings = BakeSettings { depth: 6, basis: Basis::Sh4, directions: 8, ..Default::default() };
        let ball = |density: f64| {
            let inside = move |at: DVec3| if at.length() < 0.8 { density } else { 0.0 };
            bake(&settings, inside, |_| |_| DVec3::splat(0.5)).unwrap()
        };
        let field = ball(1000.0);
        let progress = Progress::default();
        let all = visibility(&field, 1.0, false, &progress).unwrap();
        assert_eq!(progress.fraction(), 1.0);
        let cells = f64::from(1u32 << field.depth());
        for (cell, seen) in field.leaf_cells().zip(&all.leaves) {
            let center = field.frame().to_world((cell.corner.as_dvec3() + 0.5) / cells);
            if center.length() < 0.65 {
                assert_eq!((seen.most, seen.channels), (0.0, [0.0; 3]), "at {center}");
            }
            if center.length() > 0.79 {
                assert!(seen.most > 0.9, "{seen:?} at {center}");
                // Views come from outside: the mean direction of view points inward.
                let y = Basis::Sh4.evaluate(-center.normalize());
                let along: f64 = (1..4)
                    .map(|function| {
                        let views = seen.views.iter().zip(&all.directions);
                        let mean: f64 = views.map(|(view, basis)| view.to_f64() * f64::from(basis[function])).sum();
                        mean * y[function]
                    })
                    .sum();
                assert!(along > 0.05, "{along}");
            }
        }
        let haze = ball(0.01);
        let width = 2.0 / 64.0;
        let all = visibility(&haze, 1.0, false, &progress).unwrap();
        assert_eq!(progress.fraction(), 1.0);
        for seen in all.leaves {
            // The longest path through a cell is its diagonal.
            assert!(seen.most > 0.008 * width && seen.most < 0.01 * 1.8 * width, "{seen:?}");
        }
    }

    #[test]
    fn any_number_of_threads_gives_the_same_bits() {
        let settings = BakeSettings { depth: 5, ..Default::default() };
        let tint = |at: DVec3| move |direction: DVec3| 0.5 + 0.2 * at + 0.1 * direction;
        let field = bake(&settings, |at| 20.0 * at.x.max(0.0), tint).unwrap();
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| visibility(&field, 0.5, false, &Progress::default())).unwrap().leaves
        };
        assert_eq!(on(1), on(4));
    }
}
