//! The labels of a palette during a fit: how far they are from the points, and where the points pull them.

use glam::{DVec2, DVec3, swizzles::Vec2Swizzles};

use super::points::{Point, Points, to_opponent, to_rgb};
use crate::{
    palette::{
        label::PaletteLabel,
        oklab::{CHROMATIC, chroma, is_hue_off},
    },
    sampling::Progress,
};

/// Number of labels that are computed at a time.
const LANES: usize = 8;

/// How much more a palette color is pulled by the points of its own label than by those of blends, minus 1.
const OWN: f64 = 1.0;

/// How much the share of hues that are off adds to the error.
const HUE: f64 = 3.0;

/// How much a color that is never shown unblended adds to the error, and the share of the weight from which it adds
/// nothing.
const UNSEEN: f64 = 0.3;
const SEEN: f32 = 0.005;

/// Rounds of the solver, each of which solves for one palette color after another.
const ROUNDS: usize = 12;

/// The palette's colors in opponent space, and buffers that are reused from step to step.
pub(super) struct Labels<'a> {
    all: Vec<PaletteLabel>,
    /// The labels' colors and sums.
    lanes: Vec<Lanes>,
    progress: &'a Progress,
}

/// The colors of [`LANES`] labels, the sums of the points that have these labels, and space for one point.
#[derive(Clone, Copy, Default)]
struct Lanes {
    color: [[f32; LANES]; 3],
    /// Sums of the weights for luma and for chroma.
    mass: [[f32; LANES]; 2],
    /// Sums of the points' colors, with these weights.
    pull: [[f32; LANES]; 3],
    /// A point's distances, then its shares.
    share: [f32; LANES],
}

impl<'a> Labels<'a> {
    /// Returns the labels of palettes of `colors` colors, with as many blend steps as can be drawn.
    ///
    /// Once `progress` is canceled, assignments are not complete.
    pub fn new(colors: usize, blend_steps: u32, progress: &'a Progress) -> Self {
        let blend_steps = blend_steps.min(PaletteLabel::most_blend_steps(colors));
        let all: Vec<_> = PaletteLabel::all(colors, blend_steps).collect();
        Self { lanes: vec![Lanes::default(); all.len().div_ceil(LANES)], all, progress }
    }

    /// Returns the number of labels.
    pub fn len(&self) -> usize {
        self.all.len()
    }

    fn prepare(&mut self, palette: &[DVec3]) {
        // Beyond the last label, labels are so far away that no point has them.
        self.lanes.fill(Lanes { color: [[1e6; LANES]; 3], ..Lanes::default() });
        for (index, label) in self.all.iter().enumerate() {
            let color = color(label, palette);
            let lanes = &mut self.lanes[index / LANES];
            (0..3).for_each(|axis| lanes.color[axis][index % LANES] = color[axis] as f32);
        }
    }

    /// Assigns the points to the labels, softly: label `l` at the squared distance `d(l)` has the share
    /// `(1 + (d(l) - d(nearest)) / softness)^-4` of a point, over the sum of these. Calls `with` for every point, with
    /// its squared distance to the nearest label and the factors by which its shares sum to its two weights.
    fn assign(&mut self, points: &Points, softness: f32, mut with: impl FnMut(&mut [Lanes], &Point, f32, [f32; 2])) {
        for point in points.all.iter().take_while(|_| !self.progress.is_canceled()) {
            let closest = distances(&mut self.lanes, point);
            let mut totals = [0.0; LANES];
            for lanes in &mut self.lanes {
                for (share, total) in lanes.share.iter_mut().zip(&mut totals) {
                    let near = softness / (softness + *share - closest);
                    *share = (near * near) * (near * near);
                    *total += *share;
                }
            }
            let total: f32 = totals.iter().sum();
            with(&mut self.lanes, point, closest, [point.weight / total, point.chroma_weight / total]);
        }
    }

    /// Returns the palette that best fits the soft assignment of the points, and the mean squared distance of the
    /// points to the labels nearest to them.
    ///
    /// `stride` scales the step: 1 moves the colors to the optimum for this assignment, more anticipates that the
    /// assignment follows.
    pub fn step(&mut self, points: &Points, palette: &[DVec3], softness: f64, stride: f64) -> (Vec<DVec3>, f64) {
        self.prepare(palette);
        let mut nearest = 0.0;
        self.assign(points, softness as f32, |all, point, closest, scale| {
            nearest += f64::from(point.weight * closest);
            for lanes in all {
                for i in 0..LANES {
                    let [luma, chroma] = scale.map(|scale| lanes.share[i] * scale);
                    lanes.mass[0][i] += luma;
                    lanes.mass[1][i] += chroma;
                    lanes.pull[0][i] += luma * point.color[0];
                    lanes.pull[1][i] += chroma * point.color[1];
                    lanes.pull[2][i] += chroma * point.color[2];
                }
            }
        });
        (self.solve(palette, stride), nearest)
    }

    /// Returns the mean squared distance of the points to the labels that they are softly assigned to.
    fn distance(&mut self, points: &Points, palette: &[DVec3], softness: f64) -> f64 {
        self.prepare(palette);
        let mut distance = 0.0;
        self.assign(points, softness as f32, |all, point, _, scale| {
            let mut sums = [0.0; LANES];
            for lanes in all {
                for (i, sum) in sums.iter_mut().enumerate() {
                    let [luma, u, v] = [0, 1, 2].map(|axis| point.color[axis] - lanes.color[axis][i]);
                    *sum += lanes.share[i] * (scale[0] * luma * luma + scale[1] * (u * u + v * v));
                }
            }
            distance += f64::from(sums.iter().sum::<f32>());
        });
        distance
    }

    /// Solves the normal equations of the palette's colors, each within the RGB cube, one color after another, and goes
    /// `stride` times as far.
    fn solve(&self, palette: &[DVec3], stride: f64) -> Vec<DVec3> {
        let count = palette.len();
        let mut matrix = vec![DVec2::ZERO; count * count];
        let mut right = vec![DVec3::ZERO; count];
        for (index, &PaletteLabel { first, second, share, .. }) in self.all.iter().enumerate() {
            let (lanes, i) = (&self.lanes[index / LANES], index % LANES);
            let mass = DVec2::from(lanes.mass.map(|mass| f64::from(mass[i])));
            let pull = DVec3::from(lanes.pull.map(|pull| f64::from(pull[i])));
            if first == second {
                matrix[first * count + first] += (1.0 + OWN) * mass;
                right[first] += (1.0 + OWN) * pull;
                continue;
            }
            let parts = [(first, share), (second, 1.0 - share)];
            for (row, a) in parts {
                parts.iter().for_each(|&(column, b)| matrix[row * count + column] += a * b * mass);
                right[row] += a * pull;
            }
        }
        let before = palette;
        let mut palette = palette.to_vec();
        for _ in 0..ROUNDS {
            for row in 0..count {
                let others = (0..count).filter(|&column| column != row);
                let taken: DVec3 = others.map(|column| matrix[row * count + column].xyy() * palette[column]).sum();
                let own = matrix[row * count + row];
                if own.x > f64::from(f32::MIN_POSITIVE) {
                    let free = to_rgb((right[row] - taken) / own.xyy());
                    palette[row] = to_opponent(free.clamp(DVec3::ZERO, DVec3::ONE));
                }
            }
        }
        for (color, before) in palette.iter_mut().zip(before) {
            let far = to_rgb(before.lerp(*color, stride));
            *color = to_opponent(far.clamp(DVec3::ZERO, DVec3::ONE));
        }
        palette
    }

    /// Returns how badly a palette fits: the mean squared distance of the soft assignment, increased by the share of
    /// the weight that is shown with another hue, and by colors that are hardly seen.
    pub fn rate(&mut self, points: &Points, palette: &[DVec3], softness: f64) -> f64 {
        let distance = self.distance(points, palette, softness);
        let shown: Vec<DVec2> = self.all.iter().map(|label| chroma(to_rgb(color(label, palette)))).collect();
        let (mut chromatic, mut off, mut own) = (0.0, 0.0, vec![0.0; palette.len()]);
        for (point, &(seen, weight)) in points.all.iter().zip(&points.chroma) {
            let (label, _) = self.nearest_to(point);
            if let Some(own) = own.get_mut(label) {
                *own += weight;
            }
            if seen.length() > CHROMATIC {
                chromatic += weight;
                off += if is_hue_off(seen, shown[label]) { weight } else { 0.0 };
            }
        }
        let off = if chromatic > 0.0 { f64::from(off / chromatic) } else { 0.0 };
        let unseen: f32 = own.iter().map(|own| (1.0 - own / SEEN).max(0.0)).sum();
        distance * (1.0 + HUE * off + UNSEEN * f64::from(unseen))
    }

    /// Returns the nearest label of every point, and its squared distance.
    pub fn nearest(&mut self, points: &Points, palette: &[DVec3]) -> Vec<(usize, f32)> {
        self.prepare(palette);
        points.all.iter().map(|point| self.nearest_to(point)).collect()
    }

    /// Returns the label that is nearest to a point, and its squared distance. Ties go to the first label.
    fn nearest_to(&mut self, point: &Point) -> (usize, f32) {
        let closest = distances(&mut self.lanes, point);
        let mut all = self.lanes.iter().flat_map(|lanes| lanes.share);
        (all.position(|distance| distance == closest).unwrap_or(0), closest)
    }
}

/// Returns the color of a label, blended from a palette in opponent space.
fn color(label: &PaletteLabel, palette: &[DVec3]) -> DVec3 {
    label.share * palette[label.first] + (1.0 - label.share) * palette[label.second]
}

/// Computes the squared distances of a point to all labels and returns the smallest.
fn distances(lanes: &mut [Lanes], point: &Point) -> f32 {
    let mut closest = [f32::MAX; LANES];
    for Lanes { color: [x, y, z], share, .. } in lanes {
        for i in 0..LANES {
            let [dx, dy, dz] = [point.color[0] - x[i], point.color[1] - y[i], point.color[2] - z[i]];
            share[i] = dx * dx + dy * dy + dz * dz;
            closest[i] = if share[i] < closest[i] { share[i] } else { closest[i] };
        }
    }
    closest.into_iter().fold(f32::MAX, f32::min)
}
