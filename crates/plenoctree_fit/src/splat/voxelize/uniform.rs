//! Fields of finest leaves.

use std::sync::atomic::{AtomicUsize, Ordering};

use plenoctree::PlenOctree;

use super::{
    blocks::Lattice,
    cells::Cells,
    place::{MOST_CELLS, Place},
    settings::{BLUR, THINNEST, VoxelSettings, per_cell},
};
use crate::splat::{error::SplatError, splats::Splats};

/// Makes the field whose leaves are all finest cells of a capture that are not empty.
pub fn field(splats: &Splats, settings: &VoxelSettings) -> Result<PlenOctree, SplatError> {
    let place = Place::new(splats, settings)?;
    let depth = settings.depth;
    let lattice = Lattice::new(splats, place.corner, place.width(depth), depth, BLUR);
    let (count, thinnest) = (AtomicUsize::new(0), per_cell(THINNEST, depth));
    let parts = lattice.blocks(
        place.functions,
        |_| count.load(Ordering::Relaxed) <= MOST_CELLS,
        |code, block| {
            let cells = place.cells(depth, code, block, thinnest, |_| 1.0);
            count.fetch_add(cells.len(), Ordering::Relaxed);
            cells
        },
    );
    match count.into_inner() {
        0 => Err(place.empty()),
        count if count > MOST_CELLS => Err(place.too_many(settings)),
        _ => place.field(&Cells::joined(parts), depth),
    }
}
