//! A packed field as whole numbers, which its file holds.

use std::sync::Arc;

use half::f16;

use crate::field::{Activation, Basis, Cell, Coefficients, Frame, InvalidField, PlenOctree, UpAxis};

/// The largest number of densities.
pub(crate) const MAX_LEVELS: usize = 256;
/// The largest number of rows of a codebook.
pub(crate) const MAX_ROWS: usize = 1 << 16;

/// A field whose numbers are multiples of steps, or come from tables.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Quantized {
    pub frame: Frame,
    pub basis: Basis,
    pub activation: Activation,
    pub up: UpAxis,
    pub depth: u32,
    /// Nodes and leaves are in depth-first order.
    pub nodes: Vec<[Cell; 8]>,
    /// At most [`MAX_LEVELS`] densities, and which of them every leaf has.
    pub densities: Vec<f16>,
    pub levels: Vec<u8>,
    /// Coefficients of the constant function: luma, and two differences in steps twice as large. See [`Self::channels`].
    pub step: f32,
    pub constants: Vec<[i32; 3]>,
    /// Coefficients of the other functions: at most [`MAX_ROWS`] rows, and the row of every leaf. Empty if there are no
    /// other functions.
    pub table_step: f32,
    pub table: Vec<i16>,
    pub rows: Vec<u16>,
}

impl Quantized {
    /// Returns red, green and blue of luma `y` and differences `u` and `v`, all in steps.
    ///
    /// Luma is a quarter of red and blue plus half of green. `2 u` is red minus blue. `2 v` is green minus the mean of
    /// red and blue.
    pub fn channels([y, u, v]: [i32; 3]) -> [i32; 3] {
        let between = y.wrapping_sub(v);
        [between.wrapping_add(u), y.wrapping_add(v), between.wrapping_sub(u)]
    }

    /// Returns the field.
    pub fn field(self) -> Result<PlenOctree, InvalidField> {
        let coefficient = |steps: f32| {
            let k = f16::from_f32(steps);
            if k.is_finite() { k } else { f16::MAX.copysign(k) }
        };
        let constants =
            self.constants.iter().map(|all| Self::channels(*all).map(|steps| coefficient(steps as f32 * self.step)));
        let table = self.table.iter().map(|steps| coefficient(f32::from(*steps) * self.table_step));
        let coefficients = Coefficients::Shared {
            constants: Arc::new(constants.collect()),
            rows: Arc::new(self.rows),
            table: Arc::new(table.collect()),
        };
        let densities = self.levels.iter().map(|level| self.densities[usize::from(*level)].to_f32()).collect();
        PlenOctree::assemble(self.frame, self.basis, self.activation, self.up, self.nodes, densities, coefficients)
    }
}
