//! Levels: versions of a field that are cheaper to draw.

use std::sync::OnceLock;

use plenoctree::{Faintness, PlenOctree};

use crate::quality::PropQuality;

/// A version of a field: with larger cells, without faint leaves, or, by default, unchanged.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Level {
    /// How many times the width of the finest cells is doubled, up to the depth of the field.
    coarser: u32,
    /// Leaves below this density, per world unit of the field, are left out.
    density_threshold: f32,
    /// Faint leaves are left out as long as rays lose no more than this opacity.
    opacity_loss: f32,
}

impl Level {
    /// Creates the level that `quality` asks for, with the width of cells doubled `coarser` times.
    pub fn new(coarser: u32, quality: &PropQuality) -> Self {
        Self { coarser, density_threshold: quality.density_threshold, opacity_loss: quality.opacity_loss }
    }

    /// Returns how many times the width of the finest cells is doubled.
    pub fn coarser(self) -> u32 {
        self.coarser
    }

    /// Creates this version of `field`. This takes longer than a frame.
    pub(super) fn make(self, field: &PlenOctree, faintness: &OnceLock<Faintness>) -> PlenOctree {
        let mut threshold = self.density_threshold;
        if self.opacity_loss > 0.0 {
            threshold = threshold.max(faintness.get_or_init(|| Faintness::of(field)).threshold(self.opacity_loss));
        }
        let mut field = field.thinned(threshold);
        for _ in 0..self.coarser {
            let Some(next) = field.coarser(1) else { break };
            field = next;
        }
        field
    }

    /// Returns whether this level can be drawn in place of `wanted` until that one is ready: it must not leave out
    /// more.
    pub(super) fn stands_in_for(self, wanted: Self) -> bool {
        self.coarser <= wanted.coarser
            && self.density_threshold <= wanted.density_threshold
            && self.opacity_loss <= wanted.opacity_loss
    }
}
