//! Counts which tones are seen beside each other.

use std::ops::ControlFlow;

use glam::DVec3;
use rayon::prelude::*;

use crate::{
    field::PlenOctree,
    palette::{colors::Palette, space::tone_space},
    sampling::{Canceled, Progress, SamplingSettings, observers},
};

/// How often colors of a palette are seen beside each other: symmetric, with zeros on the diagonal.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Borders {
    colors: usize,
    counts: Vec<u32>,
}

/// Number of rays along each side of a view.
const SIDE: usize = 96;
/// The largest difference of depth of neighboring rays that hit the same surface, as a multiple of their distance.
const STEEP: f64 = 3.0;
/// Transmittance below which a ray ends.
const OPAQUE: f64 = 1e-2;
/// Opacity from which a ray counts.
const SEEN: f64 = 0.5;

impl Borders {
    /// Returns no borders at all.
    pub fn none(colors: usize) -> Self {
        Self { colors, counts: vec![0; colors * colors] }
    }

    /// Counts the borders in views of the field from all directions from which it is sampled. Colors are beside each
    /// other where neighboring rays see them at nearly the same depth, so that occlusion makes no border.
    pub fn of(
        field: &PlenOctree,
        palette: &Palette,
        settings: &SamplingSettings,
        progress: &Progress,
    ) -> Result<Self, Canceled> {
        let tones: Vec<DVec3> = palette.colors.iter().map(|color| tone_space((*color).into())).collect();
        let Some((low, high)) = field.dense_bounds() else { return Ok(Self::none(tones.len())) };
        let settings = SamplingSettings { multisamples: 1, ..settings.clone() };
        let directions = observers(field.up(), &settings).into_iter().flatten();
        let views: Vec<_> = directions.map(|observer| View::new(field, (low, high), observer)).collect();
        let count = |view: &View| view.borders(field, &tones, progress);
        let add = |a: Self, b: Self| {
            let counts = a.counts.iter().zip(&b.counts).map(|(a, b)| a + b).collect();
            Ok(Self { counts, ..a })
        };
        views.par_iter().map(count).try_reduce(|| Self::none(tones.len()), add)
    }

    /// Returns how often two colors are seen beside each other.
    pub fn between(&self, a: usize, b: usize) -> u32 {
        self.counts[a * self.colors + b]
    }

    fn add(&mut self, a: usize, b: usize) {
        if a != b {
            self.counts[a * self.colors + b] += 1;
            self.counts[b * self.colors + a] += 1;
        }
    }
}

/// A view of a field by parallel rays.
struct View {
    /// The origin of the first ray, and the steps to its neighbors.
    first: DVec3,
    right: DVec3,
    down: DVec3,
    direction: DVec3,
    basis: [f64; 25],
    /// The distance of neighboring rays.
    step: f64,
}

impl View {
    fn new(field: &PlenOctree, (low, high): (DVec3, DVec3), observer: DVec3) -> Self {
        let (center, radius) = (0.5 * (low + high), 0.5 * low.distance(high));
        let (right, down) = observer.any_orthonormal_pair();
        let step = 2.0 * radius / SIDE as f64;
        let corner = (0.5 - 0.5 * SIDE as f64) * step * (right + down);
        Self {
            first: center + radius * observer + corner,
            right: step * right,
            down: step * down,
            direction: -observer,
            basis: field.basis().evaluate(-observer),
            step,
        }
    }

    fn borders(&self, field: &PlenOctree, tones: &[DVec3], progress: &Progress) -> Result<Borders, Canceled> {
        let mut borders = Borders::none(tones.len());
        let mut above: Vec<Option<(usize, f64)>> = vec![None; SIDE];
        for row in 0..SIDE {
            let mut left: Option<(usize, f64)> = None;
            for (column, above) in above.iter_mut().enumerate() {
                progress.check()?;
                let origin = self.first + row as f64 * self.down + column as f64 * self.right;
                let seen = self.ray(field, origin).map(|(color, depth)| (nearest(color, tones), depth));
                for (other, depth) in [left, *above].into_iter().flatten() {
                    if let Some((own, own_depth)) = seen
                        && (own_depth - depth).abs() <= STEEP * self.step
                    {
                        borders.add(own, other);
                    }
                }
                (left, *above) = (seen, seen);
            }
        }
        Ok(borders)
    }

    /// Returns the color that a ray sees, and the depth at which it becomes half opaque, if it does.
    fn ray(&self, field: &PlenOctree, origin: DVec3) -> Option<(DVec3, f64)> {
        let (mut color, mut transmittance, mut depth) = (DVec3::ZERO, 1.0, None);
        field.march(origin, self.direction, |crossing| {
            let opacity = -(-f64::from(field.densities()[crossing.leaf as usize]) * crossing.length).exp_m1();
            color += transmittance * opacity * field.radiance_with(crossing.leaf, &self.basis);
            transmittance *= 1.0 - opacity;
            if depth.is_none() && transmittance < 1.0 - SEEN {
                depth = Some(crossing.start);
            }
            if transmittance < OPAQUE { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        Some((color / (1.0 - transmittance), depth?))
    }
}

/// Returns the tone nearest to a color in encoded sRGB.
fn nearest(color: DVec3, tones: &[DVec3]) -> usize {
    let place = tone_space(color);
    let mut best = (0, f64::INFINITY);
    for (index, tone) in tones.iter().enumerate() {
        let distance = place.distance_squared(*tone);
        if distance < best.1 {
            best = (index, distance);
        }
    }
    best.0
}
