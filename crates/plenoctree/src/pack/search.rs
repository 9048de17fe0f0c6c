//! Finds the row of a codebook with the least cost: its visible error, plus the bits of its number.
//!
//! Similar rows form groups. A leaf is compared to the means of the groups first, then to the rows of the best groups
//! and to those that cost the fewest bits.

use rayon::prelude::*;

use super::{
    leaves::Leaves,
    metric::{pairs, product},
};
use crate::sampling::{Canceled, Progress};

/// Rows that are compared together.
const LANES: usize = 16;
/// The largest number of rows in a group. The rows with the fewest bits form a group of this size, too.
const GROUP: usize = 64;
/// Groups that are searched.
const BEST: usize = 6;
/// The number of leaves between checks for cancellation.
const CHUNK: usize = 1024;

/// Returns what a leaf's query is multiplied with: the coefficients of a row, the products of all pairs of them, and
/// the bits of its number.
pub(super) fn features(leaves: &Leaves, row: &[f32], bits: f32) -> Vec<f32> {
    let mut features = row.to_vec();
    let parts = || row.chunks_exact(leaves.others()).zip(leaves.shares);
    let products = |(a, b)| parts().map(|(part, share): (&[f32], _)| share * part[a] * part[b]).sum::<f32>();
    features.extend(pairs(leaves.others()).map(products));
    features.push(bits);
    features
}

/// The [`features`] of rows.
struct Group {
    rows: Vec<u32>,
    /// For each number, those of [`LANES`] rows.
    lanes: Vec<[f32; LANES]>,
}

impl Group {
    /// `rows` are numbers, coefficients and bits.
    fn new<'a>(leaves: &Leaves, rows: impl Iterator<Item = (u32, &'a [f32], f32)>) -> Self {
        let (mut numbers, mut all) = (Vec::new(), Vec::new());
        for (number, row, bits) in rows {
            numbers.push(number);
            all.push(features(leaves, row, bits));
        }
        let width = all.first().map_or(0, Vec::len);
        let mut lanes = Vec::with_capacity(all.len().div_ceil(LANES) * width);
        for chunk in all.chunks(LANES) {
            lanes.extend((0..width).map(|place| {
                // Missing rows cost too much.
                let missing = if place + 1 == width { f32::MAX } else { 0.0 };
                std::array::from_fn(|lane| chunk.get(lane).map_or(missing, |features| features[place]))
            }));
        }
        Self { rows: numbers, lanes }
    }

    /// Calls `visit` with the costs of rows, many at a time, and the position of the first.
    fn costs(&self, query: &[f32], mut visit: impl FnMut(usize, &[f32; LANES])) {
        for (index, lanes) in self.lanes.chunks_exact(query.len()).enumerate() {
            let mut costs = [0.0f32; LANES];
            for (query, numbers) in query.iter().zip(lanes) {
                for (cost, number) in costs.iter_mut().zip(numbers) {
                    *cost += query * number;
                }
            }
            visit(index * LANES, &costs);
        }
    }
}

/// The rows of a codebook, to search in.
pub(super) struct Search<'a> {
    leaves: &'a Leaves<'a>,
    means: Group,
    cheap: Group,
    groups: Vec<Group>,
}

impl<'a> Search<'a> {
    /// `bits` are those of the rows' numbers.
    pub fn new(leaves: &'a Leaves, table: &[f32], bits: &[f32]) -> Self {
        let width = leaves.width();
        let row = |row: u32| (row, &table[row as usize * width..][..width], bits[row as usize]);
        let mut numbers: Vec<u32> = (0..bits.len() as u32).collect();
        let mut groups = Vec::new();
        halve(&mut numbers, table, width, &mut groups);
        let mean_of = |rows: &Vec<u32>| -> Vec<f32> {
            let sum = |place: usize| rows.iter().map(|row| table[*row as usize * width + place]).sum::<f32>();
            (0..width).map(|place| sum(place) / rows.len() as f32).collect()
        };
        let means: Vec<Vec<f32>> = groups.iter().map(mean_of).collect();
        let mut cheap: Vec<u32> = (0..bits.len() as u32).collect();
        cheap.sort_by(|a, b| bits[*a as usize].total_cmp(&bits[*b as usize]).then(a.cmp(b)));
        cheap.truncate(GROUP);
        Self {
            leaves,
            means: Group::new(leaves, (0..).zip(&means).map(|(index, mean)| (index, &mean[..], 0.0))),
            cheap: Group::new(leaves, cheap.into_iter().map(row)),
            groups: groups.iter().map(|rows| Group::new(leaves, rows.iter().copied().map(row))).collect(),
        }
    }

    /// Returns the best row for each leaf in `chosen`.
    pub fn best_of_all(&self, chosen: &[u32], progress: &Progress) -> Result<Vec<u32>, Canceled> {
        let of_chunk = |chunk: &[u32]| {
            progress.check()?;
            let (mut moments, mut query) = (Vec::new(), Vec::new());
            Ok(chunk.iter().map(|leaf| self.best(*leaf as usize, &mut moments, &mut query)).collect())
        };
        let found: Vec<Vec<u32>> = chosen.par_chunks(CHUNK).map(of_chunk).collect::<Result<_, Canceled>>()?;
        Ok(found.concat())
    }

    fn best(&self, leaf: usize, moments: &mut Vec<f32>, query: &mut Vec<f32>) -> u32 {
        write_query(self.leaves, leaf, moments, query);
        let mut nearest = [(f32::INFINITY, 0usize); BEST];
        self.means.costs(query, |first, costs| {
            for (lane, cost) in costs.iter().enumerate() {
                if *cost < nearest[BEST - 1].0 {
                    let place = nearest.partition_point(|(other, _)| other <= cost);
                    nearest[place..].rotate_right(1);
                    nearest[place] = (*cost, first + lane);
                }
            }
        });
        let (mut least, mut best) = (f32::INFINITY, 0);
        let found = nearest.iter().filter_map(|(_, group)| self.groups.get(*group));
        for group in std::iter::once(&self.cheap).chain(found) {
            group.costs(query, |first, costs| {
                for (lane, cost) in costs.iter().enumerate() {
                    if *cost < least {
                        (least, best) = (*cost, group.rows[first + lane]);
                    }
                }
            });
        }
        best
    }
}

/// Writes the factors of a row's numbers for a leaf. The sum of the products is the row's cost, up to a constant for
/// all rows.
pub(super) fn write_query(leaves: &Leaves, leaf: usize, moments: &mut Vec<f32>, query: &mut Vec<f32>) {
    let others = leaves.others();
    let covariances = leaves.covariances(leaf, moments);
    let weight = leaves.weight(leaf);
    query.clear();
    query.resize(leaves.width(), 0.0);
    let parts = leaves.value(leaf).chunks_exact(others).zip(leaves.shares);
    for (query, (part, share)) in query.chunks_exact_mut(others).zip(parts) {
        product(covariances, part, query);
        query.iter_mut().for_each(|number| *number *= -2.0 * share * weight);
    }
    let twice = |(a, b)| if a == b { 1.0 } else { 2.0 };
    query.extend(covariances.iter().zip(pairs(others)).map(|(number, pair)| twice(pair) * weight * number));
    query.push(1.0);
}

/// Splits rows in halves, where they vary most, until there are at most [`GROUP`] in each.
fn halve(rows: &mut [u32], table: &[f32], width: usize, groups: &mut Vec<Vec<u32>>) {
    if rows.len() <= GROUP {
        groups.push(rows.to_vec());
        return;
    }
    let value = |row: u32, axis: usize| table[row as usize * width + axis];
    let variance = |axis: usize| {
        let (sum, square) = rows.iter().fold((0.0, 0.0), |(sum, square), row| {
            let value = f64::from(value(*row, axis));
            (sum + value, square + value * value)
        });
        square - sum * sum / rows.len() as f64
    };
    let variances: Vec<f64> = (0..width).map(variance).collect();
    let axis = (0..width).max_by(|a, b| variances[*a].total_cmp(&variances[*b])).unwrap_or(0);
    let middle = rows.len() / 2;
    rows.select_nth_unstable_by(middle, |a, b| value(*a, axis).total_cmp(&value(*b, axis)).then(a.cmp(b)));
    let (low, high) = rows.split_at_mut(middle);
    halve(low, table, width, groups);
    halve(high, table, width, groups);
}
