//! Levels: versions of a field that are cheaper to draw.

use std::sync::OnceLock;

use plenoctree::{Faintness, PlenOctree};

use crate::quality::PropQuality;

/// Which version of a field: with larger cells, without faint leaves, or, by default, as it is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Level {
    /// How many times the width of the finest cells is doubled, as far as the field has levels.
    coarser: u32,
    /// Leaves with less density are left out.
    density_threshold: f32,
    /// Faint leaves are left out until rays lose this much opacity.
    opacity_loss: f32,
}

impl Level {
    /// The level that a `quality` asks for where cells may be doubled `coarser` times.
    pub fn new(coarser: u32, quality: &PropQuality) -> Self {
        Self { coarser, density_threshold: quality.density_threshold, opacity_loss: quality.opacity_loss }
    }

    /// How many times the width of the finest cells is doubled.
    pub fn coarser(self) -> u32 {
        self.coarser
    }

    /// Makes this version of a field. Takes longer than a frame may.
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

    /// Whether this level can be drawn in place of `wanted` until that one is made: it shows no less.
    pub(super) fn stands_in_for(self, wanted: Self) -> bool {
        self.coarser <= wanted.coarser
            && self.density_threshold <= wanted.density_threshold
            && self.opacity_loss <= wanted.opacity_loss
    }
}
