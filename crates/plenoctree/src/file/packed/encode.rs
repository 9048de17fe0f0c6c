//! Writes a packed field.

use super::{CONSTANTS, DENSITIES, HEAD, LEVELS, ROWS, TABLE, TREE, container, planes};
use crate::{
    field::{Activation, Basis, Cell, UpAxis},
    pack::Quantized,
};

impl Quantized {
    /// Returns the content of the file, and the name and size of every section in it.
    pub(crate) fn encode(&self) -> (Vec<u8>, Vec<(&'static str, usize)>) {
        container::build(&[
            (HEAD, self.head()),
            (TREE, self.tree()),
            (DENSITIES, planes::split(self.densities.iter().map(|density| density.to_bits().to_le_bytes()))),
            (LEVELS, self.levels.clone()),
            (CONSTANTS, self.differences()),
            (TABLE, self.columns()),
            (ROWS, planes::split(self.rows.iter().map(|row| row.to_le_bytes()))),
        ])
    }

    fn head(&self) -> Vec<u8> {
        let basis = Basis::ALL.iter().position(|basis| *basis == self.basis).unwrap_or(0) as u8;
        let activation = match self.activation {
            Activation::Sigmoid => 0,
            Activation::ShiftedRelu => 1,
            Activation::Identity => 2,
        };
        let up = u8::from(self.up == UpAxis::Z);
        let mut head = vec![basis, activation, up, self.depth as u8];
        let width = self.table_width().max(1);
        for count in [self.nodes.len(), self.levels.len(), self.densities.len(), self.table.len() / width] {
            head.extend((count as u32).to_le_bytes());
        }
        for step in [self.step, self.table_step] {
            head.extend(step.to_le_bytes());
        }
        for number in self.frame.offset.to_array().into_iter().chain(self.frame.scale.to_array()) {
            head.extend(number.to_le_bytes());
        }
        head
    }

    /// Returns the number of coefficients in a row.
    fn table_width(&self) -> usize {
        3 * (self.basis.functions() - 1)
    }

    /// Returns, for every level of nodes, which of their cells are not empty, and then which of those are leaves. The
    /// cells of the last level are not divided, so there the second part is left out.
    fn tree(&self) -> Vec<u8> {
        let bits = |cells: &[Cell; 8], holds: fn(&Cell) -> bool| {
            cells.iter().enumerate().fold(0, |bits, (index, cell)| bits | u8::from(holds(cell)) << index)
        };
        let mut bytes = Vec::new();
        let mut level = vec![0u32];
        for depth in 1..=self.depth {
            let nodes = || level.iter().map(|node| &self.nodes[*node as usize]);
            bytes.extend(nodes().map(|cells| bits(cells, |cell| *cell != Cell::EMPTY)));
            if depth < self.depth {
                bytes.extend(nodes().map(|cells| bits(cells, |cell| cell.as_leaf().is_some())));
            }
            level = nodes().flatten().filter_map(|cell| cell.as_node()).collect();
        }
        bytes
    }

    /// Returns luma of all leaves, then the two differences, each as the difference from the leaf before.
    fn differences(&self) -> Vec<u8> {
        let of_part = |part: usize| {
            let before = std::iter::once(0).chain(self.constants.iter().map(move |constant| constant[part]));
            let changes = self
                .constants
                .iter()
                .zip(before)
                .map(move |(constant, before)| planes::fold(constant[part].wrapping_sub(before)).to_le_bytes());
            planes::split(changes)
        };
        (0..3).flat_map(of_part).collect()
    }

    /// Returns the table, one column after another.
    fn columns(&self) -> Vec<u8> {
        let width = self.table_width().max(1);
        let column = |column: usize| self.table.iter().skip(column).step_by(width);
        let folded = (0..width).flat_map(column).map(|number| (planes::fold((*number).into()) as u16).to_le_bytes());
        planes::split(folded)
    }
}
