//! Writes a packed field.

use super::super::room::TooEven;
use super::{
    container, histogram,
    quantized::{Quantized, content},
    recent::Recent,
    sections::{BINS, CONSTANTS, DENSITIES, HEAD, LEVELS, ROWS, TABLE, TREE},
    streams,
};
use crate::field::{Activation, Basis, Cell, UpAxis};

impl Quantized {
    /// Returns the content of the file, and the name and size of every section in it.
    pub(crate) fn encode(&self) -> Result<(Vec<u8>, Vec<(&'static str, usize)>), TooEven> {
        let of = self.rows_of_tables();
        let (levels, count) = (&self.levels, self.densities.len());
        let others = self.basis.functions() - 1;
        let mut sections = vec![
            (HEAD, self.head()),
            (TREE, self.tree()),
            (DENSITIES, [0, 1].iter().flat_map(|byte| self.densities.iter().map(|d| d.to_le_bytes()[*byte])).collect()),
            (LEVELS, streams::write_levels(levels, count)),
            (CONSTANTS, streams::write_colors(&self.colors, levels, count)),
            (TABLE, streams::write_tables(&self.tables.luma, &self.tables.chroma, others)),
            (ROWS, streams::write_rows(&self.rows, levels, count, of)),
        ];
        sections.extend(self.recorded.as_ref().map(|recorded| (BINS, histogram::write(recorded))));
        let (bytes, sizes) = container::build(&sections);
        TooEven::check(content(levels.len() as u64, self.nodes.len() as u64), bytes.len() as u64)?;
        Ok((bytes, sizes))
    }

    /// Returns how leaves name the rows of luma and of the differences.
    fn rows_of_tables(&self) -> [streams::Rows; 2] {
        let others = (self.basis.functions() - 1).max(1);
        let counts = [self.tables.luma.len() / others, self.tables.chroma.len() / (2 * others)];
        [0, 1].map(|table| {
            let rows = self.rows.iter().map(|rows| rows[table]);
            streams::Rows {
                count: counts[table],
                first_new: streams::first_new(rows, counts[table]),
                recent: Recent::default(),
            }
        })
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
        for count in [self.nodes.len(), self.levels.len(), self.densities.len()] {
            head.extend((count as u32).to_le_bytes());
        }
        for streams::Rows { count, first_new, .. } in self.rows_of_tables() {
            head.extend([count as u32, first_new as u32].map(u32::to_le_bytes).as_flattened());
        }
        for step in [self.tables.color_step, self.tables.table_step] {
            head.extend(step.to_le_bytes());
        }
        for number in self.frame.offset.to_array().into_iter().chain(self.frame.scale.to_array()) {
            head.extend(number.to_le_bytes());
        }
        head
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
}
