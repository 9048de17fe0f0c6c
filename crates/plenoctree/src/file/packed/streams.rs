//! The coded sections: levels, colors, rows and tables. The context in which a number is coded depends on the numbers
//! before it.

use super::entropy::Decoder;
#[cfg(feature = "write")]
use super::entropy::Encoder;
use super::{
    quantized::COLOR_RANGES,
    recent::{RECENT, Recent},
};

/// The number of contexts of levels, colors and rows.
const LEVEL_CONTEXTS: usize = 9;
const COLOR_CONTEXTS: usize = 36;
const ROW_CONTEXTS: usize = 36;
/// The numbers of classes of densities, as contexts of colors and of rows.
const CLASSES: usize = 6;
const ROW_CLASSES: usize = 3;
/// The largest number that names a recent row.
const RECENT_NUMBERS: u32 = RECENT as u32;

/// Returns how many bytes a stream of so many symbols and numbers has at most, with room to spare: each takes up to 12
/// bits as a symbol and 29 plain ones, and each context up to 511 bytes.
pub fn most_bytes(numbers: u64) -> u64 {
    const CONTEXTS: u64 = 72;
    8 + 511 * CONTEXTS + 6 * numbers
}

/// Interleaves positive and negative numbers, so that small ones stay small: 0, -1, 1, -2, 2, ...
#[cfg(feature = "write")]
fn fold(number: i32) -> u32 {
    ((number << 1) ^ (number >> 31)) as u32
}

/// Undoes [`fold`].
fn unfold(number: u32) -> i32 {
    (number >> 1) as i32 ^ -((number & 1) as i32)
}

/// Returns which of `classes` a level is in.
fn class(level: u8, levels: usize, classes: usize) -> usize {
    usize::from(level) * classes / levels.max(1)
}

/// Returns the context of a leaf's level, given the level of the previous leaf.
fn level_context(before: Option<u8>, levels: usize) -> usize {
    before.map_or(0, |level| 1 + class(level, levels, LEVEL_CONTEXTS - 1))
}

/// Returns the context of a component of a color, given the previous change of this component and the changes of the
/// leaf's components before it. All are folded.
fn color_context(part: usize, class: usize, own: [u32; 3], before: [u32; 3]) -> usize {
    let size = |change: u32| match change {
        0 => 0,
        1..=4 => 1,
        _ => 2,
    };
    match part {
        0 => 3 * class + size(before[0]),
        _ => 9 + 9 * part + 3 * size(own[part - 1]) + size(before[part]),
    }
}

/// How a leaf's row is named: it is the last one, another recent one, or none of those.
fn naming(number: u32) -> usize {
    match number {
        1 => 0,
        2..=RECENT_NUMBERS => 1,
        _ => 2,
    }
}

/// Returns the contexts of the row of luma, and of that of the differences, given how the rows of the leaf before are
/// named.
fn luma_context(class: usize, before: [u32; 2]) -> usize {
    3 * class + naming(before[0])
}

fn chroma_context(class: usize, luma: u32, before: [u32; 2]) -> usize {
    9 + 9 * class + 3 * naming(luma) + naming(before[1])
}

/// Reads the level of every leaf.
pub fn read_levels(bytes: &[u8], leaves: usize, levels: usize) -> Option<Vec<u8>> {
    let mut decoder = Decoder::new(bytes, LEVEL_CONTEXTS)?;
    let mut all = Vec::with_capacity(leaves);
    let mut before = None;
    for _ in 0..leaves {
        let level = decoder.symbol(level_context(before, levels))?;
        if usize::from(level) >= levels {
            return None;
        }
        all.push(level);
        before = Some(level);
    }
    decoder.has_ended().then_some(all)
}

/// Reads the color of every leaf.
pub fn read_colors(bytes: &[u8], densities: &[u8], levels: usize) -> Option<Vec<[i16; 3]>> {
    let mut decoder = Decoder::new(bytes, COLOR_CONTEXTS)?;
    let (mut color, mut before) = ([0i16; 3], [0; 3]);
    let mut all = Vec::with_capacity(densities.len());
    for level in densities {
        let class = class(*level, levels, CLASSES);
        let mut own = [0; 3];
        for part in 0..3 {
            own[part] = decoder.number(color_context(part, class, own, before))?;
            let steps = unfold(own[part]).checked_add(color[part].into())?;
            let (low, high) = COLOR_RANGES[part];
            color[part] = i16::try_from(steps).ok().filter(|steps| (low..=high).contains(steps))?;
        }
        all.push(color);
        before = own;
    }
    decoder.has_ended().then_some(all)
}

/// The numbering of a table's rows.
#[derive(Clone, Copy)]
pub struct Rows {
    pub count: usize,
    /// The first of the rows that are stored in the order in which leaves use them.
    pub first_new: usize,
    pub recent: Recent,
}

impl Rows {
    /// Reads a row: 0 is the next one that no leaf had, the numbers up to [`RECENT_NUMBERS`] are recent ones, and
    /// others are the row plus one more than that.
    #[inline]
    fn read(&mut self, number: u32) -> Option<u16> {
        if let 1..=RECENT_NUMBERS = number {
            return Some(self.recent.take(number as usize - 1)).filter(|row| usize::from(*row) < self.count);
        }
        let row = match number.checked_sub(RECENT_NUMBERS + 1) {
            Some(row) => row as usize,
            None => {
                self.first_new += 1;
                self.first_new - 1
            }
        };
        (row < self.count).then(|| {
            self.recent.push(row as u16);
            row as u16
        })
    }

    #[cfg(feature = "write")]
    fn write(&mut self, row: u16) -> u32 {
        if let Some(place) = self.recent.find(row) {
            return place as u32 + 1;
        }
        if usize::from(row) == self.first_new {
            self.first_new += 1;
            return 0;
        }
        u32::from(row) + RECENT_NUMBERS + 1
    }
}

/// Reads the rows of every leaf.
pub fn read_rows(bytes: &[u8], densities: &[u8], levels: usize, mut of: [Rows; 2]) -> Option<Vec<[u16; 2]>> {
    let mut decoder = Decoder::new(bytes, ROW_CONTEXTS)?;
    let mut before = [0; 2];
    let mut all = Vec::with_capacity(densities.len());
    for level in densities {
        let class = class(*level, levels, ROW_CLASSES);
        let luma = decoder.number(luma_context(class, before))?;
        let chroma = decoder.number(chroma_context(class, luma, before))?;
        all.push([of[0].read(luma)?, of[1].read(chroma)?]);
        before = [luma, chroma];
    }
    decoder.has_ended().then_some(all)
}

/// Reads the tables of luma and of the differences. `others` is the number of functions without the constant one.
pub fn read_tables(bytes: &[u8], others: usize, rows: [usize; 2]) -> Option<[Vec<i8>; 2]> {
    let mut decoder = Decoder::new(bytes, 3 * others)?;
    let mut read = |first: usize, width: usize, rows: usize| -> Option<Vec<i8>> {
        let mut table = Vec::with_capacity(rows * width);
        for _ in 0..rows {
            for column in 0..width {
                let number = i8::try_from(unfold(decoder.number(first + column)?)).ok()?;
                table.push((number > i8::MIN).then_some(number)?);
            }
        }
        Some(table)
    };
    let tables = [read(0, others, rows[0])?, read(others, 2 * others, rows[1])?];
    decoder.has_ended().then_some(tables)
}

#[cfg(feature = "write")]
pub fn write_levels(levels: &[u8], count: usize) -> Vec<u8> {
    let mut encoder = Encoder::new(LEVEL_CONTEXTS);
    let mut before = None;
    for level in levels {
        encoder.symbol(level_context(before, count), *level);
        before = Some(*level);
    }
    encoder.finish()
}

#[cfg(feature = "write")]
pub fn write_colors(colors: &[[i16; 3]], densities: &[u8], levels: usize) -> Vec<u8> {
    let mut encoder = Encoder::new(COLOR_CONTEXTS);
    let (mut last, mut before) = ([0; 3], [0; 3]);
    for (color, level) in colors.iter().zip(densities) {
        let class = class(*level, levels, CLASSES);
        let mut own = [0; 3];
        for part in 0..3 {
            own[part] = fold(i32::from(color[part]) - i32::from(last[part]));
            encoder.number(color_context(part, class, own, before), own[part]);
        }
        (last, before) = (*color, own);
    }
    encoder.finish()
}

#[cfg(feature = "write")]
pub fn write_rows(rows: &[[u16; 2]], densities: &[u8], levels: usize, mut of: [Rows; 2]) -> Vec<u8> {
    let mut encoder = Encoder::new(ROW_CONTEXTS);
    let mut before = [0; 2];
    for (row, level) in rows.iter().zip(densities) {
        let class = class(*level, levels, ROW_CLASSES);
        let [luma, chroma] = [of[0].write(row[0]), of[1].write(row[1])];
        encoder.number(luma_context(class, before), luma);
        encoder.number(chroma_context(class, luma, before), chroma);
        before = [luma, chroma];
    }
    encoder.finish()
}

#[cfg(feature = "write")]
pub fn write_tables(luma: &[i8], chroma: &[i8], others: usize) -> Vec<u8> {
    let mut encoder = Encoder::new(3 * others);
    for (first, width, table) in [(0, others, luma), (others, 2 * others, chroma)] {
        for row in table.chunks_exact(width.max(1)) {
            row.iter().enumerate().for_each(|(column, number)| encoder.number(first + column, fold((*number).into())));
        }
    }
    encoder.finish()
}

/// Returns the first row of a table that is followed only by rows in the order in which leaves use them. It is not the
/// row 0, which is among the recent ones from the start.
#[cfg(feature = "write")]
pub fn first_new(rows: impl Iterator<Item = u16>, count: usize) -> usize {
    let mut firsts = vec![usize::MAX; count];
    for (leaf, row) in rows.enumerate() {
        let first = &mut firsts[usize::from(row)];
        *first = leaf.min(*first);
    }
    (1..count).rev().find(|row| firsts[row - 1] >= firsts[*row]).unwrap_or(1).min(count)
}

#[cfg(all(test, feature = "write"))]
mod tests {
    use super::*;

    #[test]
    fn folds_are_undone() {
        let numbers = [0, -1, 1, -2, 77, -300, i32::MAX, i32::MIN];
        assert_eq!(numbers.map(fold)[..4], [0, 1, 2, 3]);
        assert_eq!(numbers.map(|number| unfold(fold(number))), numbers);
    }
}
