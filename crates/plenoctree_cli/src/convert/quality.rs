//! Finds how many leaves a field needs to look as much like its capture as is asked for.

use plenoctree::PlenOctree;
use plenoctree_fit::splat::{SplatError, Splats, VoxelSettings, Voxels};

use super::measure::Pictures;
use crate::{console, number::counted};

/// The largest number of leaves.
const MOST_LEAVES: usize = 8_000_000;
/// Binary logarithm of the smallest.
const FEWEST: f64 = 10.0;
/// How often the range of numbers is halved.
const STEPS: usize = 8;

/// Makes the field with the fewest leaves, within a few percent, whose pictures over white have a mean PSNR of
/// `quality` decibels, with these settings otherwise. If none has, it has as many leaves as possible.
pub fn field(
    splats: &Splats,
    settings: VoxelSettings,
    quality: f64,
    pictures: &Pictures,
) -> Result<PlenOctree, SplatError> {
    let psnr = |field: &PlenOctree| pictures.compare(field).psnr[0];
    let voxels = Voxels::new(splats, &VoxelSettings { leaves: MOST_LEAVES, ..settings })?;
    let mut best = voxels.field(MOST_LEAVES)?;
    let found = psnr(&best);
    if found < quality {
        let leaves = counted(best.leaves(), "leaf", "leaves");
        console::complain!("warning: {leaves} give {found:.2} dB, not {quality} dB");
        return Ok(best);
    }
    let most = (best.leaves() as f64).log2();
    let (mut low, mut high) = (FEWEST.min(most), most);
    for _ in 0..STEPS {
        let middle = 0.5 * (low + high);
        let field = voxels.field(middle.exp2() as usize)?;
        if psnr(&field) >= quality {
            (best, high) = (field, middle);
        } else {
            low = middle;
        }
    }
    Ok(best)
}
