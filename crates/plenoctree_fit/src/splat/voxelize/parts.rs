//! Cubes of a few cells in a block, of which those that matter are filled.

use glam::UVec3;

use crate::cells::BLOCK;

/// Levels of cells in a part.
pub const PART: u32 = 2;
/// Parts per side of a block.
const SIDE: usize = 1 << (BLOCK - PART);

/// Some of the parts of a block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parts {
    /// For each column, at `x * SIDE + y`, a bit for each part along z.
    columns: [u8; SIDE * SIDE],
}

impl Parts {
    pub const ALL: Self = Self { columns: [u8::MAX; SIDE * SIDE] };

    /// Returns those parts that pass `keep`, given their position in the block, or `None` if there are none.
    pub fn some(keep: impl Fn(UVec3) -> bool) -> Option<Self> {
        let column = |column: usize| {
            let at = |z| UVec3::new((column / SIDE) as u32, (column % SIDE) as u32, z);
            (0..SIDE as u32).filter(|z| keep(at(*z))).map(|z| 1 << z).sum()
        };
        let columns = std::array::from_fn(column);
        columns.iter().any(|column| *column != 0).then_some(Self { columns })
    }

    /// Returns the first and the last place of a column of cells, along z, between which all of its cells in these
    /// parts are, or `None` if it has none.
    #[inline(always)]
    pub fn range(&self, x: usize, y: usize) -> Option<[usize; 2]> {
        let column = self.columns[(x >> PART) * SIDE + (y >> PART)];
        let end = (u8::BITS - column.leading_zeros()) as usize;
        (end > 0).then(|| [(column.trailing_zeros() as usize) << PART, (end << PART) - 1])
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// All cells of parts are within the range of their column, whose ends are among them.
        #[test]
        fn ranges_are_those_of_parts(chosen in prop::collection::vec(any::<bool>(), SIDE * SIDE * SIDE)) {
            let index = |part: UVec3| ((part.x as usize * SIDE) + part.y as usize) * SIDE + part.z as usize;
            // Half of the columns are empty.
            let is_chosen = |part: UVec3| part.y.is_multiple_of(2) && chosen[index(part)];
            let Some(parts) = Parts::some(is_chosen) else { return Ok(()) };
            for x in 0..1 << BLOCK {
                for y in 0..1 << BLOCK {
                    let mut own = (0..1 << BLOCK).filter(|z| is_chosen(UVec3::new(x, y, *z) >> PART)).map(|z| z as usize);
                    let range = own.next().map(|first| [first, own.next_back().unwrap_or(first)]);
                    prop_assert_eq!(parts.range(x as usize, y as usize), range);
                }
            }
        }
    }
}
