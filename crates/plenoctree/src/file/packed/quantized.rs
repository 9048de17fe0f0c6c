//! A packed field as the integers that its file stores.

use std::sync::Arc;

use half::f16;

use crate::{
    field::{Activation, Basis, Cell, Coefficients, Densities, Frame, PlenOctree, Tables, UpAxis},
    sampling::Recorded,
};

/// The largest number of densities.
pub(crate) const MAX_LEVELS: usize = 254;
/// The largest number of rows of a codebook.
pub(crate) const MAX_ROWS: usize = 1 << 16;
/// The ranges of a leaf's luma and differences: 12, 10 and 10 bits.
pub(crate) const COLOR_RANGES: [(i16, i16); 3] = [(-2048, 2047), (-512, 511), (-512, 511)];

/// Returns the memory of a field in bytes: densities, colors and rows per leaf, and cells per node.
pub(crate) fn content(leaves: u64, nodes: u64) -> u64 {
    11 * leaves + 32 * nodes
}

/// A field whose numbers are multiples of steps, or come from tables.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Quantized {
    pub frame: Frame,
    pub basis: Basis,
    pub activation: Activation,
    pub up: UpAxis,
    pub depth: u32,
    /// Nodes and leaves are in depth-first order, and as deep as `depth` says.
    pub nodes: Vec<[Cell; 8]>,
    /// At most [`MAX_LEVELS`] densities, and which of them every leaf has.
    pub densities: Vec<f16>,
    pub levels: Vec<u8>,
    /// As in a [`Codebook`](crate::Codebook).
    pub colors: Vec<[i16; 3]>,
    pub rows: Vec<[u16; 2]>,
    pub tables: Tables,
    /// The histograms of the field before it was packed.
    pub recorded: Option<Arc<Recorded>>,
}

impl Quantized {
    /// Returns the field.
    pub fn field(self) -> PlenOctree {
        let coefficients = Coefficients::Shared {
            colors: Arc::new(self.colors),
            rows: Arc::new(self.rows),
            tables: Arc::new(self.tables),
        };
        let values = self.densities.iter().map(|density| density.to_f32()).collect();
        let densities = Densities::shared(values, self.levels);
        let Self { frame, basis, activation, up, depth, nodes, recorded, .. } = self;
        PlenOctree::of_valid(frame, basis, activation, up, depth, nodes, densities, coefficients)
            .with_recorded(recorded)
    }
}
