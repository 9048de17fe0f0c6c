//! What parallel rays see of a field from all directions from which it is sampled.

use std::ops::ControlFlow;

use glam::DVec3;
use rayon::prelude::*;

use crate::{
    field::PlenOctree,
    sampling::{Canceled, Progress, SamplingSettings, observers},
};

/// A view of a field by parallel rays, on a square grid.
pub(super) struct View {
    /// The distance of neighboring rays.
    pub step: f64,
    /// What the rays see, row by row, or `None` where a ray does not become half opaque.
    pub seen: Vec<Option<Seen>>,
}

/// What a ray sees. With 32 bits, because there are many.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    color: [f32; 3],
    /// The depth at which the ray becomes half opaque.
    pub depth: f32,
}

impl Seen {
    /// Returns the color in encoded sRGB.
    pub fn color(&self) -> DVec3 {
        DVec3::from(self.color.map(f64::from))
    }
}

/// The share of views in the time that a palette of tones takes after sampling.
const SHARE: f32 = 0.3;
/// Transmittance below which a ray ends.
const OPAQUE: f64 = 1e-2;
/// Opacity from which a ray counts.
const SEEN: f64 = 0.5;

impl View {
    /// Number of rays along each side.
    pub const SIDE: usize = 96;

    /// Returns a view from each direction from which the settings sample a field, or none if it is empty.
    pub fn all(field: &PlenOctree, settings: &SamplingSettings, progress: &Progress) -> Result<Vec<Self>, Canceled> {
        let Some(bounds) = field.dense_bounds() else { return Ok(Vec::new()) };
        let settings = SamplingSettings { multisamples: 1, ..settings.clone() };
        let directions: Vec<DVec3> = observers(field.up(), &settings).into_iter().flatten().collect();
        let view = |observer: &DVec3| {
            let view = Self::new(field, bounds, *observer, progress);
            progress.compute(SHARE / directions.len() as f32);
            view
        };
        directions.par_iter().map(view).collect()
    }

    fn new(
        field: &PlenOctree,
        (low, high): (DVec3, DVec3),
        observer: DVec3,
        progress: &Progress,
    ) -> Result<Self, Canceled> {
        let (center, radius) = (0.5 * (low + high), 0.5 * low.distance(high));
        let (right, down) = observer.any_orthonormal_pair();
        let step = 2.0 * radius / Self::SIDE as f64;
        let first = center + radius * observer + (0.5 - 0.5 * Self::SIDE as f64) * step * (right + down);
        let basis = field.basis().evaluate(-observer);
        let mut seen = Vec::with_capacity(Self::SIDE * Self::SIDE);
        for row in 0..Self::SIDE {
            progress.check()?;
            for column in 0..Self::SIDE {
                let origin = first + step * (row as f64 * down + column as f64 * right);
                seen.push(see(field, origin, -observer, &basis));
            }
        }
        Ok(Self { step, seen })
    }
}

fn see(field: &PlenOctree, origin: DVec3, direction: DVec3, basis: &[f64; 25]) -> Option<Seen> {
    let (mut color, mut transmittance, mut depth) = (DVec3::ZERO, 1.0, None);
    field.march(origin, direction, |crossing| {
        let opacity = -(-f64::from(field.densities()[crossing.leaf as usize]) * crossing.length).exp_m1();
        color += transmittance * opacity * field.radiance_with(crossing.leaf, basis);
        transmittance *= 1.0 - opacity;
        if depth.is_none() && transmittance < 1.0 - SEEN {
            depth = Some(crossing.start as f32);
        }
        if transmittance < OPAQUE { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    Some(Seen { color: (color / (1.0 - transmittance)).as_vec3().to_array(), depth: depth? })
}
