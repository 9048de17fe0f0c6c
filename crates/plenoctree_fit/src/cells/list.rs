//! Cells of different sizes.

/// Levels of cells in a block.
pub const BLOCK: u32 = 5;

/// Cells of different sizes that do not overlap. A code is that of a cell's lowest corner among the finest cells.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cells {
    pub codes: Vec<u64>,
    /// How often each cell would have to be split to get finest cells.
    pub levels: Vec<u8>,
    /// Density times the width of the cell.
    pub thickness: Vec<f32>,
    /// How visible each cell is: the mean square of the transmittance of what is in front of it. The unit is free.
    pub seen: Vec<f32>,
    /// The coefficients of each cell: red, green and blue for each function.
    pub colors: Vec<f32>,
}

impl Cells {
    /// Joins lists of cells.
    pub fn joined(parts: Vec<Self>) -> Self {
        let mut all = Self::default();
        for mut part in parts {
            all.codes.append(&mut part.codes);
            all.levels.append(&mut part.levels);
            all.thickness.append(&mut part.thickness);
            all.seen.append(&mut part.seen);
            all.colors.append(&mut part.colors);
        }
        all
    }

    /// Drops all but the first `count` cells.
    pub fn truncate(&mut self, count: usize) {
        self.colors.truncate(count * self.stride());
        self.codes.truncate(count);
        self.levels.truncate(count);
        self.thickness.truncate(count);
        self.seen.truncate(count);
    }

    pub fn len(&self) -> usize {
        self.codes.len()
    }

    pub fn push(&mut self, code: u64, level: u8, thickness: f32, seen: f32, color: &[f32]) {
        self.codes.push(code);
        self.levels.push(level);
        self.thickness.push(thickness);
        self.seen.push(seen);
        self.colors.extend_from_slice(color);
    }

    /// Adds the cell at an index of another list.
    pub fn push_from(&mut self, other: &Self, cell: usize) {
        let Self { codes, levels, thickness, seen, .. } = other;
        self.push(codes[cell], levels[cell], thickness[cell], seen[cell], other.color(cell));
    }

    /// Returns the coefficients of a cell.
    pub fn color(&self, cell: usize) -> &[f32] {
        let stride = self.stride();
        &self.colors[cell * stride..][..stride]
    }

    /// Returns the number of coefficients of a cell.
    pub fn stride(&self) -> usize {
        self.colors.len() / self.len().max(1)
    }

    /// Returns the cells that pass `keep`, by index, in one list for each block, in the order of their codes.
    pub fn blocks(&self, keep: impl Fn(usize) -> bool) -> Vec<Self> {
        let mut order: Vec<usize> = (0..self.len()).filter(|cell| keep(*cell)).collect();
        order.sort_by_key(|cell| self.codes[*cell]);
        let block = |cells: &[usize]| {
            let mut own = Self::default();
            cells.iter().for_each(|cell| own.push_from(self, *cell));
            own
        };
        order.chunk_by(|a, b| self.codes[*a] >> (3 * BLOCK) == self.codes[*b] >> (3 * BLOCK)).map(block).collect()
    }
}
