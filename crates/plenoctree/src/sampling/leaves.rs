//! Selects the leaves to sample, and bounds their weight.

use super::{
    progress::{Canceled, Progress},
    sample_point::SamplePoint,
};
use crate::field::{LeafCell, PlenOctree};
use crate::histograms::SamplingSettings;
use crate::random::Random;

/// Returns the leaves to sample, in the order of the octree. These are all leaves, or one from every stratum of `1 /
/// sample_fraction` consecutive leaves, which are neighbors in space.
pub(super) fn chosen_leaves(
    field: &PlenOctree,
    settings: &SamplingSettings,
    progress: &Progress,
) -> Result<Vec<LeafCell>, Canceled> {
    let mut leaves = Vec::with_capacity(field.leaves());
    for cell in field.leaf_cells() {
        progress.check()?;
        leaves.push(cell);
    }
    let fraction = settings.sample_fraction.unwrap_or(1.0);
    if fraction >= 1.0 {
        return Ok(leaves);
    }
    let strata = (leaves.len() as f64 * fraction).ceil() as usize;
    let begin = |stratum: usize| (stratum as u128 * leaves.len() as u128 / strata as u128) as usize;
    // The same position in every stratum would alias with the order of the octree.
    let mut random = Random::new(0);
    (0..strata)
        .map(|stratum| {
            progress.check()?;
            let (first, end) = (begin(stratum), begin(stratum + 1));
            Ok(leaves[first + (random.bits() % (end - first) as u64) as usize])
        })
        .collect()
}

/// Returns an upper bound of the total weight of a field's radiance samples. The light of a leaf always crosses half of
/// its own cell, or, from the point where rays enter the leaf, is the mean along a path through all of it. Both limit
/// its weight.
pub(super) fn weight_bound(
    field: &PlenOctree,
    settings: &SamplingSettings,
    point: SamplePoint,
    progress: &Progress,
) -> Result<f64, Canceled> {
    let finest = f64::from(1u32 << field.depth());
    let half_cell = 0.5 / (finest * field.frame().scale.max_element());
    let mut sum = 0.0;
    for cell in field.leaf_cells() {
        progress.check()?;
        let density = f64::from(field.densities()[cell.leaf as usize]);
        let own = density * half_cell * f64::from(cell.size);
        sum += match point {
            SamplePoint::Center => density * (-own).exp(),
            SamplePoint::Entry => density * point.share(own),
        };
    }
    Ok(sum * settings.direction_cells() as f64)
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;
    use crate::{
        bake::{BakeSettings, bake},
        field::Basis,
    };
    use glam::DVec3;

    #[test]
    fn a_fraction_of_the_leaves_is_chosen_evenly() {
        let settings = BakeSettings { depth: 4, basis: Basis::Sh1, ..Default::default() };
        let field = bake(&settings, |at| if at.length() < 0.9 { 5.0 } else { 0.0 }, |_| |_| DVec3::ONE).unwrap();
        for fraction in [1.0, 0.7, 0.5, 0.1, 0.01] {
            let settings = SamplingSettings { sample_fraction: Some(fraction), ..Default::default() };
            let chosen = chosen_leaves(&field, &settings, &Progress::default()).unwrap();
            let distinct: HashSet<u32> = chosen.iter().map(|cell| cell.leaf).collect();
            assert_eq!(distinct.len(), chosen.len());
            assert_eq!(chosen.len(), (fraction * field.leaves() as f64).ceil() as usize);
            // Every stratum holds one, so gaps are less than two strata.
            let longest = chosen.windows(2).map(|pair| pair[1].leaf - pair[0].leaf).max().unwrap_or(0);
            assert!(f64::from(longest) < 2.0 / fraction + 2.0, "{fraction}: {longest}");
        }
    }
}
