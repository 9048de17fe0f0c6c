//! A codebook: rows of coefficients that leaves share.
//!
//! Points are the coefficients of the leaves, except those of the constant function. Rows start as the means of parts
//! that points are split into, and are moved by Lloyd's algorithm. A leaf gets the row with the least cost: its error,
//! weighted by how the leaf is seen, plus the bits that name the row in the file. These are few if an earlier leaf has
//! the row. The first row is 0.

use std::cmp::Reverse;

use rayon::prelude::*;

use super::{
    colors::nearest,
    leaves::Leaves,
    metric::{add_diagonal, product, solve},
    reuse::{Costs, reuse},
    search::Search,
    split::{Points, split},
};
use crate::file::Recent;
use crate::sampling::{Canceled, Progress};

/// Rounds of Lloyd's algorithm.
const ROUNDS: usize = 3;
/// Leaves that would save fewer bits get the first row.
const LEAST_BITS: f32 = 2.0;
/// The largest coefficient of a row, in steps.
const LARGEST: f32 = 127.0;

/// A codebook, and the row of every leaf.
#[derive(Default)]
pub(super) struct Book {
    /// Rows, in steps.
    pub table: Vec<i8>,
    pub rows: Vec<u16>,
}

/// The largest step that makes room for larger coefficients, in encoded sRGB. What exceeds its room is clipped.
const ROOM_UP_TO: f32 = 0.01;

/// A codebook before its coefficients are rounded.
pub(super) struct Draft {
    /// The leaves that may have other rows than the first.
    chosen: Vec<u32>,
    table: Vec<f32>,
    costs: Costs,
}

impl Draft {
    /// Makes at most `most` rows.
    pub fn new(leaves: &Leaves, most: usize, progress: &Progress) -> Result<Self, Canceled> {
        let count = leaves.seen.len();
        if leaves.width() == 0 || count == 0 {
            return Ok(Self { chosen: Vec::new(), table: Vec::new(), costs: Costs::guess(0) });
        }
        let all: Vec<u32> = (0..count as u32).collect();
        let is_worth = |leaf: &u32| leaves.worth(*leaf as usize, &mut Vec::new()) > LEAST_BITS;
        let chosen: Vec<u32> = all.into_par_iter().filter(is_worth).collect();
        progress.check()?;
        let mut table = start(leaves, &chosen, most, progress)?;
        let mut costs = Costs::guess(table.len() / leaves.width());
        for _ in 0..ROUNDS {
            let rows = assigned(leaves, &chosen, &table, &costs, progress)?;
            costs = Costs::of(&rows, costs.rows.len());
            table = moved(leaves, &rows, table, None, progress)?;
        }
        Ok(Self { chosen, table, costs })
    }

    /// Returns the least step with which hardly any coefficient is clipped, in encoded sRGB, or [`ROOM_UP_TO`] if that
    /// is less. `unit` is the coefficient of encoded sRGB.
    pub fn least_step(&self, unit: f32) -> f32 {
        let most = self.table.iter().fold(0.0, |most: f32, value| most.max(value.abs()));
        (most / (LARGEST * unit)).min(ROOM_UP_TO)
    }

    /// Returns the codebook, whose coefficients are multiples of `step`.
    pub fn finished(self, leaves: &Leaves, step: f32, progress: &Progress) -> Result<Book, Canceled> {
        let Self { chosen, table, costs } = self;
        if table.is_empty() {
            return Ok(Book::default());
        }
        let rows = assigned(leaves, &chosen, &table, &costs, progress)?;
        let table = moved(leaves, &rows, table, Some(step), progress)?;
        let rows = assigned(leaves, &chosen, &table, &Costs::of(&rows, costs.rows.len()), progress)?;
        Ok(sorted(leaves.width(), &rows, &table, step))
    }
}

/// Returns the row of every leaf. Leaves that are not `chosen` get the first row, or one that an earlier leaf has.
fn assigned(
    leaves: &Leaves,
    chosen: &[u32],
    table: &[f32],
    costs: &Costs,
    progress: &Progress,
) -> Result<Vec<u16>, Canceled> {
    let found = Search::new(leaves, table, &costs.rows).best_of_all(chosen, progress)?;
    let mut best = vec![0; leaves.seen.len()];
    chosen.iter().zip(&found).for_each(|(leaf, row)| best[*leaf as usize] = *row as u16);
    reuse(leaves, table, costs, &best, progress)
}

/// Returns rows to start from.
fn start(leaves: &Leaves, chosen: &[u32], most: usize, progress: &Progress) -> Result<Vec<f32>, Canceled> {
    let width = leaves.width();
    let (mut squares, mut total) = (0.0, 0.0);
    for leaf in chosen {
        let weight = f64::from(leaves.weight(*leaf as usize));
        squares += weight * leaves.value(*leaf as usize).iter().map(|k| f64::from(k * k)).sum::<f64>();
        total += weight * width as f64;
    }
    let deviation = (squares / total.max(f64::MIN_POSITIVE)).sqrt() as f32;
    let values: Vec<Vec<f32>> =
        chosen.par_iter().map(|leaf| leaves.likeliest(*leaf as usize, deviation, &mut Vec::new())).collect();
    let weights = chosen.iter().map(|leaf| leaves.weight(*leaf as usize)).collect();
    let points = Points { width, values: values.concat(), weights };
    let mut table = vec![0.0; width];
    if most > 1 && !chosen.is_empty() {
        table.extend(split(&points, most - 1, progress)?.0);
    }
    Ok(table)
}

/// Moves every row but the first to where the error of its leaves is least. With a `step`, rounds its coefficients to
/// multiples of it, more coarsely where that saves bits. Rows without leaves stay as they are.
fn moved(
    leaves: &Leaves,
    rows: &[u16],
    mut table: Vec<f32>,
    step: Option<f32>,
    progress: &Progress,
) -> Result<Vec<f32>, Canceled> {
    let (others, width) = (leaves.others(), leaves.width());
    // The leaves of each row.
    let mut ends = vec![0; table.len() / width + 1];
    rows.iter().for_each(|row| ends[usize::from(*row) + 1] += 1);
    (1..ends.len()).for_each(|row| ends[row] += ends[row - 1]);
    let mut places = ends.clone();
    let mut members = vec![0; rows.len()];
    for (leaf, row) in (0u32..).zip(rows) {
        let place = &mut places[usize::from(*row)];
        members[*place] = leaf;
        *place += 1;
    }
    table.par_chunks_exact_mut(width).enumerate().skip(1).try_for_each(|(row, values)| {
        progress.check()?;
        let members = &members[ends[row]..ends[row + 1]];
        let pairs = others * (others + 1) / 2;
        let (mut matrix, mut vectors) = (vec![0.0; pairs], vec![0.0; width]);
        let (mut moments, mut image) = (Vec::new(), vec![0.0; others]);
        for leaf in members {
            let leaf = *leaf as usize;
            let weight = f64::from(leaves.weight(leaf));
            let covariances = leaves.covariances(leaf, &mut moments);
            matrix.iter_mut().zip(covariances).for_each(|(sum, number)| *sum += weight * f64::from(*number));
            for (sums, part) in vectors.chunks_exact_mut(others).zip(leaves.value(leaf).chunks_exact(others)) {
                product(covariances, part, &mut image);
                sums.iter_mut().zip(&image).for_each(|(sum, number)| *sum += weight * f64::from(*number));
            }
        }
        let mut diagonal = Vec::with_capacity(others);
        let mut place = 0;
        for row in 0..others {
            diagonal.push(matrix[place] as f32);
            place += others - row;
        }
        let trace: f32 = diagonal.iter().sum();
        if trace > 0.0 {
            add_diagonal(&mut matrix, others, 1e-3 * f64::from(trace) / others as f64);
            for (vector, values) in vectors.chunks_exact_mut(others).zip(values.chunks_exact_mut(others)) {
                solve(&matrix, vector);
                values.iter_mut().zip(vector).for_each(|(value, number)| *value = *number as f32);
            }
        }
        if let Some(step) = step {
            for (part, share) in values.chunks_exact_mut(others).zip(leaves.shares) {
                for (value, mass) in part.iter_mut().zip(&diagonal) {
                    let steps = (*value / step).clamp(-LARGEST, LARGEST);
                    *value = nearest(steps, 0, mass * share * step * step) as f32 * step;
                }
            }
        }
        Ok(())
    })?;
    Ok(table)
}

/// Drops unused rows except the first, and sorts the others: first those that the file names often, most often first,
/// then the rest in the order of the leaves that use them. A row that is still among the recent ones is not named.
fn sorted(width: usize, rows: &[u16], table: &[f32], step: f32) -> Book {
    /// The least number of times that a row is named to be sorted by that number.
    const FREQUENT: usize = 12;
    let mut counts = vec![0usize; table.len() / width];
    let mut recent = Recent::default();
    rows.iter().filter(|row| recent.find(**row).is_none()).for_each(|row| counts[usize::from(*row)] += 1);
    let mut order: Vec<u16> = vec![0];
    order.extend((1..counts.len()).filter(|row| counts[*row] >= FREQUENT).map(|row| row as u16));
    order[1..].sort_by_key(|row| (Reverse(counts[usize::from(*row)]), *row));
    let mut places = vec![None; counts.len()];
    order.iter().zip(0..).for_each(|(row, place)| places[usize::from(*row)] = Some(place));
    for row in rows {
        if places[usize::from(*row)].is_none() {
            places[usize::from(*row)] = Some(order.len() as u16);
            order.push(*row);
        }
    }
    Book {
        table: order
            .iter()
            .flat_map(|row| &table[usize::from(*row) * width..][..width])
            .map(|value| (value / step).round() as i8)
            .collect(),
        rows: rows.iter().map(|row| places[usize::from(*row)].unwrap_or(0)).collect(),
    }
}
