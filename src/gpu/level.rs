//! Levels: versions of a field that are cheaper to draw.

use std::sync::OnceLock;

use plenoctree::{Faintness, PlenOctree};

use crate::{background::on_cores, quality::PropQuality};

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
    /// Creates the level that `quality` selects, with the width of cells doubled `coarser` times.
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
            let faintness = faintness.get_or_init(|| on_cores(|| Faintness::measure(field)));
            threshold = threshold.max(faintness.threshold(self.opacity_loss));
        }
        let thinned = field.thinned(threshold);
        // Without its faintest leaves, the field may already be coarser than it was.
        let lost = field.depth() - thinned.depth();
        let levels = self.coarser.saturating_sub(lost).min(thinned.depth() - 1);
        on_cores(|| thinned.coarser(levels)).unwrap_or(thinned)
    }

    /// Returns whether this level can be drawn in place of `wanted` until that one is ready: it must not leave more
    /// out.
    pub(super) fn stands_in_for(self, wanted: Self) -> bool {
        self.coarser <= wanted.coarser
            && self.density_threshold <= wanted.density_threshold
            && self.opacity_loss <= wanted.opacity_loss
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use half::f16;
    use plenoctree::{Activation, Basis, Cell, Frame, UpAxis};

    use super::*;

    /// If the finest leaves are too faint to be kept, the others become no larger than requested.
    #[test]
    fn leaving_out_the_finest_leaves_enlarges_no_others() {
        const DEPTH: u32 = 4;
        let nodes = (1..=DEPTH).map(|level| {
            let mut node = [Cell::EMPTY; 8];
            node[0] = Cell::leaf(level - 1);
            if level < DEPTH {
                node[7] = Cell::node(level);
            }
            node
        });
        let (frame, densities) = (Frame::spanning(DVec3::ZERO, DVec3::ONE), vec![9.0, 9.0, 9.0, 0.1]);
        let field = PlenOctree::new(
            frame,
            Basis::Rgba,
            Activation::Identity,
            UpAxis::Y,
            nodes.collect(),
            densities,
            vec![f16::ONE; 3 * DEPTH as usize],
        )
        .unwrap();
        for (coarser, density_threshold, depth) in
            [(0, 0.0, 4), (1, 0.0, 3), (0, 1.0, 3), (1, 1.0, 3), (2, 1.0, 2), (3, 1.0, 1), (9, 1.0, 1), (9, 0.0, 1)]
        {
            let level = Level { coarser, density_threshold, opacity_loss: 0.0 };
            let made = level.make(&field, &OnceLock::new());
            assert_eq!(made.depth(), depth, "{level:?}");
        }
    }
}
