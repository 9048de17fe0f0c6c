//! Grows a palette tone by tone, each where it helps most.

use glam::{DVec3, swizzles::Vec3Swizzles};
use rayon::prelude::*;

use super::{neutral::neutral, points::Point};
use crate::{
    palette::{colors::Palette, method::ColorCount, oklab::from_oklab, space::nearest},
    sampling::{Canceled, Progress},
};

/// When a palette has enough tones.
pub(in crate::palette) enum Enough<'a> {
    /// When it has this many.
    Count(usize),
    /// When its error is this small, but at [`ColorCount::MOST_TONES`] at the latest.
    Error(f64),
    /// When this says so, but at [`ColorCount::MOST_TONES`] at the latest.
    Palette(&'a dyn Fn(&Palette) -> Result<bool, Canceled>),
}

/// The root mean square error below which a palette is exact.
const EXACT: f64 = 1e-9;
/// The share of a new tone in the time that a palette takes after sampling.
const SHARE: f32 = 0.01;
/// Number of steps of k-means after each new tone.
const STEPS: usize = 60;

/// Returns the tones of points, with the heaviest first, or `None` if there are no points.
pub(in crate::palette) fn tones(
    points: &[Point],
    enough: Enough,
    progress: &Progress,
) -> Result<Option<Palette>, Canceled> {
    if points.is_empty() {
        return Ok(None);
    }
    let mut tones = Tones { points, places: Vec::new(), own: vec![(0, f64::INFINITY); points.len()], progress };
    loop {
        tones.add()?;
        tones.settle()?;
        let done = match enough {
            Enough::Count(count) => tones.places.len() >= count,
            Enough::Error(most) => tones.places.len() >= ColorCount::MOST_TONES || tones.error() <= most,
            Enough::Palette(is_enough) => tones.places.len() >= ColorCount::MOST_TONES || is_enough(&tones.palette())?,
        };
        if done || tones.error() < EXACT {
            break;
        }
    }
    tones.swap()?;
    // Tones that have moved may miss again what was enough before.
    if let Enough::Palette(is_enough) = enough {
        while tones.places.len() < ColorCount::MOST_TONES && tones.error() >= EXACT && !is_enough(&tones.palette())? {
            tones.add()?;
            tones.settle()?;
        }
    }
    Ok(Some(tones.palette()))
}

struct Tones<'a> {
    points: &'a [Point],
    /// The tones in tone space.
    places: Vec<DVec3>,
    /// The nearest tone of each point, and the square of its distance.
    own: Vec<(usize, f64)>,
    progress: &'a Progress,
}

impl Tones<'_> {
    /// Adds a tone at the point where it lowers the error most. Ties go to the first point.
    fn add(&mut self) -> Result<(), Canceled> {
        let gain = |candidate: &Point| {
            self.progress.check()?;
            let gains = self.points.iter().zip(&self.own).map(|(point, (_, distance))| {
                point.salient * (distance.min(1e6) - point.place.distance_squared(candidate.place)).max(0.0)
            });
            Ok(gains.sum::<f64>())
        };
        let gains: Vec<f64> = self.points.par_iter().map(gain).collect::<Result<_, _>>()?;
        let best = (0..gains.len()).reduce(|best, i| if gains[i] > gains[best] { i } else { best }).unwrap_or(0);
        self.places.push(self.points[best].place);
        self.assign();
        self.progress.compute(SHARE);
        Ok(())
    }

    /// Moves the tones to the means of their points until they rest.
    fn settle(&mut self) -> Result<(), Canceled> {
        for _ in 0..STEPS {
            self.progress.check()?;
            let mut sums = vec![(DVec3::ZERO, 0.0); self.places.len()];
            for (point, (own, _)) in self.points.iter().zip(&self.own) {
                sums[*own].0 += point.salient * point.place;
                sums[*own].1 += point.salient;
            }
            for (place, (sum, weight)) in self.places.iter_mut().zip(sums) {
                if weight > 0.0 {
                    *place = sum / weight;
                }
            }
            if !self.assign() {
                break;
            }
        }
        Ok(())
    }

    /// Finds the nearest tone of every point, and returns whether any has changed. Ties go to the first tone.
    fn assign(&mut self) -> bool {
        let places = &self.places;
        let assign = |(point, own): (&Point, &mut (usize, f64))| {
            let nearest = nearest(point.place, places.iter().copied());
            std::mem::replace(own, nearest).0 != nearest.0
        };
        self.points.par_iter().zip(&mut self.own).with_min_len(256).map(assign).reduce(|| false, |a, b| a | b)
    }

    /// Returns the root mean square distance to the nearest tone.
    fn error(&self) -> f64 {
        self.squares().sqrt()
    }

    fn squares(&self) -> f64 {
        self.points.iter().zip(&self.own).map(|(point, (_, distance))| point.salient * distance).sum()
    }

    /// Moves single tones to where they help more, as long as that lowers the error.
    fn swap(&mut self) -> Result<(), Canceled> {
        for _ in 0..self.places.len() {
            let before = (self.squares(), self.places.clone(), self.own.clone());
            let Some(idle) = self.cheapest() else { break };
            self.places.remove(idle);
            self.assign();
            self.add()?;
            self.settle()?;
            if self.squares() >= before.0 * (1.0 - 1e-3) {
                (_, self.places, self.own) = before;
                break;
            }
        }
        Ok(())
    }

    /// Returns the tone without which the error grows least, if there are several.
    fn cheapest(&self) -> Option<usize> {
        let mut costs = vec![0.0; self.places.len()];
        for (point, (own, distance)) in self.points.iter().zip(&self.own) {
            let others = self.places.iter().enumerate().filter(|(index, _)| index != own);
            let second = others.map(|(_, place)| point.place.distance_squared(*place)).fold(f64::INFINITY, f64::min);
            costs[*own] += point.salient * (second - distance);
        }
        (0..costs.len()).filter(|_| costs.len() > 1).reduce(|best, i| if costs[i] < costs[best] { i } else { best })
    }

    /// Returns the palette: the mean colors of what is nearest to each tone, grays without the tint of a few.
    fn palette(&self) -> Palette {
        let mut sums = vec![Sum::default(); self.places.len()];
        for (point, (own, _)) in self.points.iter().zip(&self.own) {
            sums[*own].add(point);
        }
        sums.retain(|sum| sum.weight > 0.0);
        sums.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        let total: f64 = sums.iter().map(|sum| sum.weight).sum();
        let color = |sum: &Sum| (from_oklab(sum.color()).clamp(DVec3::ZERO, DVec3::ONE).to_array(), sum.weight / total);
        let (colors, weights) = sums.iter().map(color).unzip();
        Palette::weighted(colors, weights)
    }
}

/// What the members of a tone add up to.
#[derive(Clone, Copy, Default)]
struct Sum {
    weight: f64,
    oklab: DVec3,
    /// The squares of their chroma.
    squares: f64,
}

impl Sum {
    fn add(&mut self, point: &Point) {
        self.weight += point.weight;
        self.oklab += point.weight * point.oklab;
        self.squares += point.weight * point.oklab.yz().length_squared();
    }

    /// Returns the tone's color in Oklab.
    fn color(&self) -> DVec3 {
        let mean = self.oklab / self.weight;
        neutral(mean, self.squares / self.weight - mean.yz().length_squared())
    }
}
