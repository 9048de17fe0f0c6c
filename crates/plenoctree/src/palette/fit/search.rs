//! The search for the palette that fits best: from a few seeds, by exchanging one color after another.

use glam::DVec3;

use super::{
    labels::Labels,
    points::{Points, to_rgb},
};
use crate::sampling::Progress;

/// How the search ends.
struct Style {
    /// The final softness of labels, relative to the mean squared distance to the nearest label.
    softness: f64,
    /// Number of palettes that are fitted to the end.
    candidates: usize,
}

/// Softer labels give more stable palettes, harder labels fit better.
const SOFT: Style = Style { softness: 1.0, candidates: 1 };

/// For colors far from each other. Soft labels between such colors would pull the palette together, which makes labels
/// softer still. Here, the best palettes often have colors that are seen only in blends, and so are not final.
const HARD: Style = Style { softness: 0.1, candidates: KEPT };

/// The share of the error below which hard labels are worth being less stable.
const WORTH: f64 = 0.8;

/// Number of points per palette color up to which hard labels are always tried, because there may be few colors.
const SPARSE: usize = 24;

/// The least softness: the square of a hundredth of a channel.
const LEAST_SOFTNESS: f64 = 1e-4;

/// The initial softness, relative to the variance of the colors.
const INITIAL_SOFTNESS: f64 = 0.1;

/// How slowly softness decreases, per step.
const COOLING: f64 = 0.75;

/// How far steps go at the end. Where labels overlap, the colors approach their places slowly otherwise.
const STRIDE: f64 = 1.8;

/// Distance in RGB below which two palettes, or two colors of one, are the same.
const SAME: f64 = 0.03;

/// Exponents of weight in the choice of seeds.
const SEEDS: [f64; 3] = [0.5, 0.3, 0.75];

/// Number of colors that are tried in the place of each palette color.
const SUBSTITUTES: usize = 9;

/// Number of rounds of exchanges.
const EXCHANGES: usize = 6;

/// Number of palettes that are kept from round to round.
const KEPT: usize = 12;

/// Numbers of palettes that remain in each final round, and of steps by which they are fitted to all points.
const FINALS: [(usize, usize); 2] = [(10, 2), (3, 6)];

/// Number of distances of a point to a label that exchanges may compute, per cubed number of colors, and at most.
const WORK: usize = 15_000;
const MOST_WORK: usize = 200_000_000;

/// Finds the palette of at most `colors` colors (encoded sRGB) whose labels are nearest to the points.
///
/// `few` and `many` are the same points, merged more and less. Palettes are found in the former, and then fitted to the
/// latter.
///
/// Once `progress` is canceled, returns some palette soon.
pub(super) fn search(
    few: &Points,
    many: &Points,
    colors: usize,
    blend_steps: u32,
    progress: &Progress,
) -> Vec<[f64; 3]> {
    let (mut best, all_seen) = find(few, many, colors, blend_steps, &SOFT, progress);
    if !all_seen || many.all.len() <= SPARSE * colors {
        let (hard, _) = find(few, many, colors, blend_steps, &HARD, progress);
        if hard.error < WORTH * best.error {
            best = hard;
        }
    }
    best.palette.into_iter().map(|color| to_rgb(color).clamp(DVec3::ZERO, DVec3::ONE).into()).collect()
}

/// Finds the palette, and its error with hard labels. Also returns whether each of its colors was different from the
/// others and seen, so that none had to be replaced.
fn find(
    few: &Points,
    many: &Points,
    colors: usize,
    blend_steps: u32,
    style: &Style,
    progress: &Progress,
) -> (Rated, bool) {
    let labels = || Labels::new(colors, blend_steps, progress);
    let mut fit = Fit { points: few, labels: labels(), progress, relative: style.softness, stride: 1.0 };
    let initial = INITIAL_SOFTNESS * few.variance();
    let seeded = SEEDS.map(|exponent| fit.anneal(&seeds(few, colors, exponent), initial, 12));
    let softness = seeded.iter().map(|(_, softness)| *softness).fold(f64::INFINITY, f64::min);
    let mut pool: Vec<Rated> = seeded.into_iter().map(|(palette, _)| fit.rate(palette, softness)).collect();
    keep(&mut pool, KEPT);
    let mut work = (WORK * colors.pow(3)).min(MOST_WORK);
    for _ in 0..EXCHANGES {
        let before = pool[0].palette.clone();
        fit.exchange(&mut pool, softness, &mut work);
        if progress.is_canceled() || difference(&before, &pool[0].palette) < SAME {
            break;
        }
    }

    let mut fit = Fit { points: many, labels: labels(), progress, relative: style.softness, stride: STRIDE };
    for (kept, steps) in FINALS {
        fit.improve(&mut pool, kept.max(style.candidates), softness, steps);
    }
    pool.truncate(style.candidates);
    let finish = |rated: Rated| {
        let mut fit = Fit { points: many, labels: labels(), progress, relative: style.softness, stride: STRIDE };
        let (palette, softness) = fit.anneal(&rated.palette, softness, 28);
        let (palette, all_seen) = prune(fit, palette, softness, blend_steps);
        let error = Labels::new(palette.len(), blend_steps, progress).rate(many, &palette, LEAST_SOFTNESS);
        (Rated { palette, error }, all_seen)
    };
    let (first, others) = (finish(pool.remove(0)), pool.into_iter().map(finish));
    others.fold(first, |best, next| if next.0.error < best.0.error { next } else { best })
}

/// A palette in opponent space, and its error.
struct Rated {
    palette: Vec<DVec3>,
    error: f64,
}

/// A fit of palettes with the same number of colors to the same points.
struct Fit<'a> {
    points: &'a Points,
    labels: Labels<'a>,
    progress: &'a Progress,
    /// The final softness, relative to the mean squared distance to the nearest label.
    relative: f64,
    /// How far steps go.
    stride: f64,
}

impl Fit<'_> {
    /// Fits a palette while its labels become less and less soft, then for up to `steps` steps more. Returns the
    /// palette and the final softness.
    fn anneal(&mut self, palette: &[DVec3], mut softness: f64, mut steps: usize) -> (Vec<DVec3>, f64) {
        let mut palette = palette.to_vec();
        while steps > 0 && !self.progress.is_canceled() {
            let (next, nearest) = self.labels.step(self.points, &palette, softness, self.stride);
            let moved = next.iter().zip(&palette).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
            palette = next;
            let least = (self.relative * nearest).max(LEAST_SOFTNESS);
            softness = (COOLING * softness).max(least);
            if softness == least {
                steps -= 1;
                if moved < 1e-4 {
                    break;
                }
            }
        }
        (palette, softness)
    }

    fn rate(&mut self, palette: Vec<DVec3>, softness: f64) -> Rated {
        let error = self.labels.rate(self.points, &palette, softness);
        Rated { palette, error }
    }

    /// Replaces each color of the best palette with each of the colors that are shown worst, and keeps the best of the
    /// resulting palettes.
    fn exchange(&mut self, pool: &mut Vec<Rated>, softness: f64, work: &mut usize) {
        let best = pool[0].palette.clone();
        let distances = self.labels.nearest(self.points, &best).into_iter().map(|(_, distance)| f64::from(distance));
        let substitutes = farthest(self.points, distances.collect(), SUBSTITUTES, 0.5);
        let cost = 4 * self.points.all.len() * self.labels.len();
        for place in 0..best.len() {
            for &substitute in &substitutes {
                if *work < cost {
                    continue;
                }
                *work -= cost;
                let mut palette = best.clone();
                palette[place] = substitute;
                let (palette, _) = self.anneal(&palette, softness, 3);
                pool.push(self.rate(palette, softness));
            }
        }
        self.improve(pool, KEPT, softness, 6);
    }

    /// Returns the last color of a palette that is the same as another one or nearest to no point, if there is one, and
    /// the point that is shown worst, if any is not shown exactly.
    fn idle(&mut self, palette: &[DVec3]) -> (Option<usize>, Option<DVec3>) {
        let nearest = self.labels.nearest(self.points, palette);
        let seen = |i: usize| nearest.iter().any(|&(label, _)| label == i);
        let twin = |i: usize| (0..i).any(|j| palette[i].distance(palette[j]) < SAME);
        let idle = (0..palette.len()).rev().find(|&i| !seen(i) || twin(i));
        let distances = nearest.iter().map(|&(_, distance)| f64::from(distance)).collect();
        (idle, farthest(self.points, distances, 1, 0.5).pop())
    }

    /// Keeps the best `most` palettes, fits them for up to `steps` steps more, and sorts them again.
    fn improve(&mut self, pool: &mut Vec<Rated>, most: usize, softness: f64, steps: usize) {
        keep(pool, most);
        for rated in &mut *pool {
            let (palette, _) = self.anneal(&rated.palette, softness, steps);
            *rated = self.rate(palette, softness);
        }
        keep(pool, most);
    }
}

/// Sorts palettes by their errors, and keeps the first `most` different ones.
fn keep(pool: &mut Vec<Rated>, most: usize) {
    pool.sort_by(|a, b| a.error.total_cmp(&b.error));
    let mut kept: Vec<Rated> = Vec::new();
    for rated in pool.drain(..) {
        if kept.len() < most && kept.iter().all(|other| difference(&other.palette, &rated.palette) >= SAME) {
            kept.push(rated);
        }
    }
    *pool = kept;
}

/// Returns the largest distance from a color of one palette to the nearest color of the other.
fn difference(a: &[DVec3], b: &[DVec3]) -> f64 {
    let to_nearest =
        |color: &DVec3, all: &[DVec3]| all.iter().map(|x| x.distance(*color)).fold(f64::INFINITY, f64::min);
    let from_a = a.iter().map(|color| to_nearest(color, b));
    from_a.chain(b.iter().map(|color| to_nearest(color, a))).fold(0.0, f64::max)
}

/// Returns heavy points that are far from each other.
fn seeds(points: &Points, count: usize, exponent: f64) -> Vec<DVec3> {
    let mut seeds = farthest(points, vec![1.0; points.all.len()], count, exponent);
    // Fewer points than colors: the labels of equal colors share their points.
    let found = seeds.len();
    (found..count).for_each(|index| seeds.push(seeds[index - found]));
    seeds
}

/// Returns up to `count` points, each of which has the largest product of its weight, raised to `exponent`, and its
/// squared distance to the nearest of those chosen before. `distances` are the squared distances to begin with.
fn farthest(points: &Points, mut distances: Vec<f64>, count: usize, exponent: f64) -> Vec<DVec3> {
    let weights: Vec<f64> = points.all.iter().map(|point| f64::from(point.weight).powf(exponent)).collect();
    let mut chosen = Vec::new();
    while chosen.len() < count {
        let score = |i: usize| weights[i] * distances[i];
        let best = (0..weights.len()).reduce(|best, i| if score(i) > score(best) { i } else { best });
        let Some(best) = best.filter(|&best| score(best) > 0.0) else { break };
        let color = points.all[best].position();
        chosen.push(color);
        for (distance, point) in distances.iter_mut().zip(&points.all) {
            *distance = distance.min(point.position().distance_squared(color));
        }
    }
    chosen
}

/// Replaces colors that are the same as another one, or that are nearest to no point, with colors that are shown badly,
/// and fits them all again. If this does not help, drops them, and adds colors that are shown badly. Also returns
/// whether there were none.
fn prune(mut fit: Fit, mut palette: Vec<DVec3>, softness: f64, blend_steps: u32) -> (Vec<DVec3>, bool) {
    let (most, progress) = (palette.len(), fit.progress);
    let mut tries = 0;
    while palette.len() > 1 && !progress.is_canceled() {
        let (idle, worst) = fit.idle(&palette);
        match (idle, worst) {
            (None, _) => break,
            (Some(idle), Some(worst)) if tries < most => palette[idle] = worst,
            (Some(idle), _) => {
                palette.remove(idle);
                fit.labels = Labels::new(palette.len(), blend_steps, progress);
            }
        }
        tries += 1;
        palette = fit.anneal(&palette, softness, 24).0;
    }
    while palette.len() < most && !progress.is_canceled() {
        let Some(worst) = fit.idle(&palette).1 else { break };
        let more = [&palette[..], &[worst]].concat();
        fit.labels = Labels::new(more.len(), blend_steps, progress);
        if fit.idle(&more).0.is_some() {
            break;
        }
        palette = more;
    }
    (palette, tries == 0)
}
