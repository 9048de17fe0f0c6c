//! Raw radiance samples: colors as the field stores them, visible or not.

use std::ops::ControlFlow;

use glam::{DVec3, UVec3};
use plenoctree::{
    LeafCell, PlenOctree,
    random::Random,
    sampling::{Progress, SamplingPlan, SamplingSettings},
};
use rayon::prelude::*;

use super::colors::WeightedColors;

/// The number of samples: as many as an image of 800 x 800 pixels has, as in figures 9 and 10 of the paper.
pub const COUNT: usize = 640_000;

/// Of this many samples, one is examined more closely.
const STRIDE: usize = 16;

/// Radiance samples that were drawn at random among all leaves and directions, without weights.
pub struct RawSamples {
    /// The colors, rounded to 8 bits like the pixels of an image.
    pub colors: WeightedColors,
    /// Every sixteenth sample, in the order in which they were drawn.
    pub some: Vec<RawSample>,
}

/// A single sample.
pub struct RawSample {
    /// Its color.
    pub color: [f64; 3],
    /// Whether it is visible from outside.
    pub seen: bool,
    /// The color of the next leaf along x in the same direction, if there is one.
    pub neighbor: Option<[f64; 3]>,
}

impl RawSamples {
    /// Draws the samples. Returns `None` if the field has no leaves.
    ///
    /// The rays are those of the palette's sampling: 64 from the center of every leaf, with the default settings.
    pub fn draw(field: &PlenOctree, settings: &SamplingSettings) -> Option<Self> {
        // Nothing cancels it.
        let plan = SamplingPlan::new(field, settings, &Progress::default()).ok()?;
        if plan.leaves.is_empty() {
            return None;
        }
        let rays: Vec<DVec3> = plan.observers.into_iter().flatten().collect();
        let bases: Vec<_> = rays.iter().map(|&observer| field.basis().evaluate(-observer)).collect();
        let mut random = Random::new(640_000);
        let drawn: Vec<_> = (0..COUNT).map(|_| (random.below(plan.leaves.len()), random.below(rays.len()))).collect();
        let radiance = |leaf: u32, ray: usize| {
            let color = field.radiance_with(leaf, &bases[ray]).to_array();
            color.map(|channel| (255.0 * channel.clamp(0.0, 1.0)).round() / 255.0)
        };
        let colors: Vec<[f64; 3]> =
            drawn.par_iter().map(|&(leaf, ray)| radiance(plan.leaves[leaf].leaf, ray)).collect();

        let cells = 1u32 << field.depth();
        let sample = |index: usize| {
            let (leaf, ray) = drawn[index];
            let LeafCell { corner, size, .. } = plan.leaves[leaf];
            let center = field.frame().to_world((corner.as_dvec3() + 0.5 * f64::from(size)) / f64::from(cells));
            let seen = transmittance(field, center, rays[ray]) >= settings.stop_transmittance;
            let next = (corner.x + size < cells).then(|| field.locate(corner + size * UVec3::X).0.as_leaf());
            let neighbor = next.flatten().map(|leaf| radiance(leaf, ray));
            RawSample { color: colors[index], seen, neighbor }
        };
        let some = (0..COUNT).into_par_iter().step_by(STRIDE).map(sample).collect();
        Some(Self { colors: WeightedColors::new(&colors), some })
    }
}

/// Returns the transmittance from a point to the edge of the field.
pub fn transmittance(field: &PlenOctree, point: DVec3, toward: DVec3) -> f64 {
    // exp(-20) is invisible in any image.
    const OPAQUE: f64 = 20.0;
    let mut depth = 0.0;
    field.march(point, toward, |crossing| {
        depth += f64::from(field.densities()[crossing.leaf as usize]) * crossing.length;
        if depth > OPAQUE { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    (-depth).exp()
}
