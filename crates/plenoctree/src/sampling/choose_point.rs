//! Chooses the point of leaves at which radiance is sampled: section 3 of the method, step 3.

use rayon::prelude::*;

use super::{
    directions::observers,
    leaves::chosen_leaves,
    march::optical_depth,
    progress::{Canceled, Progress},
    sample_point::SamplePoint,
};
use crate::{
    field::{LeafCell, PlenOctree},
    histograms::SamplingSettings,
};

/// The largest number of leaves that are examined, as long as any of them is seen.
const EXAMINED: usize = 4096;
/// The largest share of what observers see that sampling at the centers of leaves may leave out.
const LEFT_OUT: f64 = 0.5;
/// Optical depth beyond which nothing is visible, whatever the settings say: the smallest number above 0 in 32 bits.
const OPAQUE: f64 = 87.0;

impl SamplePoint {
    /// Chooses the point for a field: [`Self::Entry`] if more than half of what observers see is in leaves that hide
    /// their own centers, by [`SamplingSettings::stop_transmittance`].
    ///
    /// The light of each leaf is weighted by the area of the leaf, its opacity, and the transmittance to the observer.
    /// Every direction cell counts by its first ray. Of large fields, this examines 4096 leaves, or all of them if none
    /// of these is seen.
    pub(super) fn choose(
        field: &PlenOctree,
        settings: &SamplingSettings,
        progress: &Progress,
    ) -> Result<Self, Canceled> {
        // Infinite if the threshold is 0.
        let limit = (-settings.stop_transmittance.ln()).min(OPAQUE);
        let finest = f64::from(1u32 << field.depth());
        // Half of the diagonal of a cell: no path from the center is longer.
        let half_diagonal = 0.5 * field.frame().scale.recip().length() / finest;
        let hides = |leaf: &LeafCell| density(field, leaf) * half_diagonal * f64::from(leaf.size) > limit;
        if !field.leaf_cells().any(|leaf| hides(&leaf)) {
            return Ok(Self::Center);
        }
        let rays: Vec<_> = observers(field.up(), settings)
            .into_iter()
            .filter_map(|cell| Some(*cell.first()? * field.frame().scale * finest))
            .collect();
        let of_leaf = |leaf: &LeafCell| {
            progress.check()?;
            let (mut seen, mut left_out) = (0.0, 0.0);
            for &ray in &rays {
                let depth = optical_depth(field, *leaf, ray, Self::Entry, limit);
                if depth > limit {
                    continue;
                }
                let own = density(field, leaf) * 0.5 * f64::from(leaf.size) / ray.abs().max_element();
                let light = f64::from(leaf.size).powi(2) * (-depth).exp() * -(-2.0 * own).exp_m1();
                seen += light;
                left_out += if own > limit { light } else { 0.0 };
            }
            Ok((seen, left_out))
        };
        let examine = |fraction: f64| -> Result<_, Canceled> {
            let settings = SamplingSettings { sample_fraction: Some(fraction), ..settings.clone() };
            let leaves = chosen_leaves(field, &settings, progress)?;
            let sums: Vec<_> = leaves.par_iter().map(of_leaf).collect::<Result<_, Canceled>>()?;
            Ok(sums.iter().fold((0.0, 0.0), |sum, leaf| (sum.0 + leaf.0, sum.1 + leaf.1)))
        };
        let fraction = (EXAMINED as f64 / field.leaves() as f64).min(1.0);
        let (mut seen, mut left_out) = examine(fraction)?;
        if seen == 0.0 && fraction < 1.0 {
            // A few large leaves may hide all others.
            (seen, left_out) = examine(1.0)?;
        }
        Ok(if left_out > LEFT_OUT * seen { Self::Entry } else { Self::Center })
    }
}

fn density(field: &PlenOctree, leaf: &LeafCell) -> f64 {
    f64::from(field.densities()[leaf.leaf as usize])
}
