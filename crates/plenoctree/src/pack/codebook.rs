//! A codebook: rows of coefficients that leaves share.
//!
//! Points are the coefficients of the leaves, except those of the constant function. Rows start as the means of parts that
//! points are split into, and are moved by Lloyd's algorithm. A leaf gets the row with the least error, weighted by how the
//! leaf is seen, plus what the row's number costs in the file. The first row is 0.

use rayon::prelude::*;

use super::{
    colors::nearest,
    metric::{Metric, product, solve},
    search::Search,
    split::{Points, split},
};
use crate::sampling::{Canceled, Progress, Seen};

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

/// Parts of the coefficients of leaves: their luma, or both differences.
pub(super) struct Leaves<'a> {
    pub metric: &'a Metric,
    pub seen: &'a [Seen],
    /// How much an error counts in each part, relative to the leaf's weight.
    pub shares: &'static [f32],
    /// For each leaf, the coefficients of its parts.
    pub values: Vec<f32>,
    /// Bits that a squared coefficient of an averagely visible leaf is worth.
    pub scale: f32,
}

impl Leaves<'_> {
    pub fn others(&self) -> usize {
        self.metric.others()
    }

    pub fn shares(&self) -> &[f32] {
        self.shares
    }

    /// Returns the number of coefficients of a leaf.
    pub fn width(&self) -> usize {
        self.shares.len() * self.others()
    }

    pub fn value(&self, leaf: usize) -> &[f32] {
        &self.values[leaf * self.width()..][..self.width()]
    }

    pub fn weight(&self, leaf: usize) -> f32 {
        self.seen[leaf].total() * self.scale
    }

    /// Returns the covariances of the functions over the views of a leaf.
    pub fn covariances<'m>(&self, leaf: usize, moments: &'m mut Vec<f32>) -> &'m [f32] {
        self.metric.of(&self.seen[leaf].views, moments);
        &moments[self.others()..]
    }

    /// Returns how many bits it is worth to keep a leaf's coefficients.
    fn worth(&self, leaf: usize, moments: &mut Vec<f32>) -> f32 {
        let covariances = self.covariances(leaf, moments);
        let mut image = vec![0.0; self.others()];
        let parts = self.value(leaf).chunks_exact(self.others()).zip(self.shares);
        let squares = parts.map(|(part, share)| {
            product(covariances, part, &mut image);
            share * part.iter().zip(&image).map(|(a, b)| a * b).sum::<f32>()
        });
        self.weight(leaf) * squares.sum::<f32>()
    }

    /// Returns a leaf's coefficients made smaller where nobody sees them: those that are the likeliest, if coefficients
    /// vary by `deviation`.
    fn likeliest(&self, leaf: usize, deviation: f32, moments: &mut Vec<f32>) -> Vec<f32> {
        let others = self.others();
        let covariances = self.covariances(leaf, moments);
        let mut values = Vec::with_capacity(self.width());
        for (part, share) in self.value(leaf).chunks_exact(others).zip(self.shares) {
            let weight = self.weight(leaf) * share;
            let mut image = vec![0.0; others];
            product(covariances, part, &mut image);
            let mut vector: Vec<f64> = image.iter().map(|number| f64::from(weight * number)).collect();
            let mut matrix: Vec<f64> = covariances.iter().map(|number| f64::from(weight * number)).collect();
            // Bits of a normal distribution: the square over the variance, by 2 ln 2.
            add_diagonal(&mut matrix, others, 0.72 / f64::from(deviation * deviation).max(1e-20));
            solve(&matrix, &mut vector);
            values.extend(vector.iter().map(|number| *number as f32));
        }
        values
    }
}

fn add_diagonal(matrix: &mut [f64], count: usize, number: f64) {
    let mut place = 0;
    for row in 0..count {
        matrix[place] += number;
        place += count - row;
    }
}

/// Builds a codebook of at most `most` rows, whose coefficients are multiples of `step`.
pub(super) fn build(leaves: &Leaves, most: usize, step: f32, progress: &Progress) -> Result<Book, Canceled> {
    let count = leaves.seen.len();
    if leaves.width() == 0 || count == 0 {
        return Ok(Book::default());
    }
    let all: Vec<u32> = (0..count as u32).collect();
    let is_worth = |leaf: &u32| leaves.worth(*leaf as usize, &mut Vec::new()) > LEAST_BITS;
    let chosen: Vec<u32> = all.into_par_iter().filter(is_worth).collect();
    progress.check()?;
    let mut table = start(leaves, &chosen, most, progress)?;
    let mut bits = vec![0.0; table.len() / leaves.width()];
    let mut rows = Vec::new();
    for _ in 0..ROUNDS {
        rows = Search::new(leaves, &table, &bits).best_of_all(&chosen, progress)?;
        bits = bits_of(&rows, bits.len(), count);
        table = moved(leaves, &chosen, &rows, table, None, progress)?;
    }
    let table = moved(leaves, &chosen, &rows, table, Some(step), progress)?;
    let rows = Search::new(leaves, &table, &bits).best_of_all(&chosen, progress)?;
    let mut of_leaves = vec![0; count];
    chosen.iter().zip(&rows).for_each(|(leaf, row)| of_leaves[*leaf as usize] = *row);
    Ok(sorted(leaves.width(), &of_leaves, &table, step))
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

/// Returns what the number of each row costs, in bits. Leaves that are not among `rows` have the first row.
fn bits_of(rows: &[u32], count: usize, leaves: usize) -> Vec<f32> {
    let mut counts = vec![0u32; count];
    counts[0] = (leaves - rows.len()) as u32;
    rows.iter().for_each(|row| counts[*row as usize] += 1);
    let total = leaves as f32 + 0.5 * count as f32;
    counts.into_iter().map(|count| (total / (count as f32 + 0.5)).log2()).collect()
}

/// Moves every row but the first to where the error of its leaves is least. With a `step`, rounds its coefficients to
/// multiples of it, more coarsely where that saves bits. Rows without leaves stay as they are.
fn moved(
    leaves: &Leaves,
    chosen: &[u32],
    rows: &[u32],
    mut table: Vec<f32>,
    step: Option<f32>,
    progress: &Progress,
) -> Result<Vec<f32>, Canceled> {
    let (others, width) = (leaves.others(), leaves.width());
    // The leaves of each row.
    let mut ends = vec![0; table.len() / width + 1];
    rows.iter().for_each(|row| ends[*row as usize + 1] += 1);
    (1..ends.len()).for_each(|row| ends[row] += ends[row - 1]);
    let mut places = ends.clone();
    let mut members = vec![0; rows.len()];
    for (leaf, row) in chosen.iter().zip(rows) {
        members[places[*row as usize]] = *leaf;
        places[*row as usize] += 1;
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

/// Drops unused rows, but not the first, and sorts the others: frequent ones by how many leaves have them, then the rest in
/// the order in which leaves have them.
fn sorted(width: usize, rows: &[u32], table: &[f32], step: f32) -> Book {
    /// Leaves of a row that is frequent.
    const FREQUENT: usize = 12;
    let mut counts = vec![0usize; table.len() / width];
    rows.iter().for_each(|row| counts[*row as usize] += 1);
    let mut order: Vec<u32> = vec![0];
    order.extend((1..counts.len() as u32).filter(|row| counts[*row as usize] >= FREQUENT));
    order[1..].sort_by_key(|row| (std::cmp::Reverse(counts[*row as usize]), *row));
    let mut places = vec![None; counts.len()];
    order.iter().zip(0..).for_each(|(row, place)| places[*row as usize] = Some(place));
    for row in rows {
        if places[*row as usize].is_none() {
            places[*row as usize] = Some(order.len() as u16);
            order.push(*row);
        }
    }
    Book {
        table: order
            .iter()
            .flat_map(|row| &table[*row as usize * width..][..width])
            .map(|value| (value / step).round() as i8)
            .collect(),
        rows: rows.iter().map(|row| places[*row as usize].unwrap_or(0)).collect(),
    }
}
