//! The codebook: rows of coefficients that leaves share.
//!
//! Points are the coefficients of the leaves, except those of the constant function. Rows start as the means of parts that
//! points are split into, and are moved by Lloyd's algorithm. A leaf gets the row with the least error, weighted by how the
//! leaf is seen in each channel, plus what the row's number costs in the file.

use std::{cmp::Ordering, collections::BinaryHeap};

use half::f16;
use rayon::prelude::*;

use super::PackSettings;
use crate::{
    field::PlenOctree,
    sampling::{Canceled, Progress, Seen},
};

/// Points from which rows are learned, at most: every n-th.
const LEARNED: usize = 1 << 16;
/// Rounds of Lloyd's algorithm.
const ROUNDS: usize = 4;
/// Points that are compared to rows together.
const LANES: usize = 16;
/// Least weight of a leaf's channel, relative to the mean, so that rows of hidden leaves are not arbitrary.
const LEAST: f32 = 1e-4;

/// A codebook, and the row of every leaf.
pub(super) struct Book {
    /// Rows, the most frequent first.
    pub table: Vec<f32>,
    pub rows: Vec<u16>,
}

/// Builds the codebook of a field. It is empty if the basis has only one function.
pub(super) fn build(
    field: &PlenOctree,
    seen: &[Seen],
    settings: &PackSettings,
    progress: &Progress,
) -> Result<Book, Canceled> {
    let others = field.basis().functions() - 1;
    if others == 0 || seen.is_empty() {
        return Ok(Book { table: Vec::new(), rows: Vec::new() });
    }
    let mut values = Vec::with_capacity(seen.len() * 3 * others);
    // In bits per squared coefficient: the mean square of every function on the sphere is that of the constant one.
    let scale = settings.bits(1.0 / settings.unit(field));
    for leaf in 0..seen.len() {
        field.stored().visit(field.basis(), leaf, |function, k| {
            if function > 0 {
                values.push(k.to_f32());
            }
        });
    }
    let weights = seen.iter().map(|seen| seen.channels.map(|weight| weight.max(LEAST) * scale)).collect();
    let points = Points { others, values, weights };
    learn(&points, settings.rows as usize, progress)
}

/// Rounds a table to multiples of a step: `step`, or a larger one if that is too fine for its numbers.
pub(super) fn whole(table: &[f32], step: f32) -> (Vec<i16>, f32) {
    let most = table.iter().fold(0.0, |most: f32, k| most.max(k.abs()));
    let step = step.max(most / f32::from(i16::MAX));
    (table.iter().map(|k| (k / step).round() as i16).collect(), step)
}

/// Returns at most `most` colors, and which of them stands for each of these. Colors stay exact if they are that few.
pub(crate) fn shared(colors: &[[f16; 3]], most: usize) -> (Vec<[f16; 3]>, Vec<u16>) {
    let values = colors.as_flattened().iter().map(|k| k.to_f32()).collect();
    let points = Points { others: 1, values, weights: vec![[1.0; 3]; colors.len()] };
    if colors.is_empty() {
        return (Vec::new(), Vec::new());
    }
    // Not canceled.
    let (table, rows) = split(&points, most, &Progress::default()).unwrap_or_default();
    let table = table.chunks_exact(3).map(|color| [0, 1, 2].map(|channel| f16::from_f32(color[channel])));
    (table.collect(), rows.into_iter().map(|row| row as u16).collect())
}

/// Points, and their weights in each channel.
struct Points {
    /// Number of coefficients per channel.
    others: usize,
    values: Vec<f32>,
    weights: Vec<[f32; 3]>,
}

impl Points {
    fn width(&self) -> usize {
        3 * self.others
    }

    fn len(&self) -> usize {
        self.weights.len()
    }

    fn value(&self, point: usize) -> &[f32] {
        &self.values[point * self.width()..][..self.width()]
    }

    /// Returns the weight of a coefficient.
    fn weight(&self, point: usize, place: usize) -> f32 {
        self.weights[point][place / self.others]
    }

    /// Returns every n-th point, so that they are no more than `most`.
    fn some(&self, most: usize) -> Self {
        let every = self.len().div_ceil(most).max(1);
        let chosen = || (0..self.len()).step_by(every);
        Self {
            others: self.others,
            values: chosen().flat_map(|point| self.value(point)).copied().collect(),
            weights: chosen().map(|point| self.weights[point]).collect(),
        }
    }
}

fn learn(points: &Points, most: usize, progress: &Progress) -> Result<Book, Canceled> {
    let sample = points.some(LEARNED);
    let (mut table, _) = split(&sample, most, progress)?;
    let mut costs = vec![0.0; table.len() / points.width()];
    for _ in 0..ROUNDS {
        let rows = assign(&sample, &table, &costs, progress)?;
        costs = costs_of(&rows, costs.len());
        table = means(&sample, &rows, table);
    }
    let rows = assign(points, &table, &costs, progress)?;
    let table = means(points, &rows, table);
    Ok(sorted(points.width(), &rows, &table))
}

/// Returns what the number of each row costs, in bits.
fn costs_of(rows: &[u32], count: usize) -> Vec<f32> {
    let mut counts = vec![0u32; count];
    rows.iter().for_each(|row| counts[*row as usize] += 1);
    let total = (rows.len() + count) as f32;
    counts.into_iter().map(|count| (total / (count + 1) as f32).log2()).collect()
}

/// Returns the weighted mean of the points of every row. Rows without points stay as they are.
fn means(points: &Points, rows: &[u32], mut table: Vec<f32>) -> Vec<f32> {
    let width = points.width();
    let mut sums = vec![(0.0f64, 0.0f64); table.len()];
    for (point, row) in rows.iter().enumerate() {
        let sums = &mut sums[*row as usize * width..][..width];
        for (place, ((sum, total), value)) in sums.iter_mut().zip(points.value(point)).enumerate() {
            let weight = points.weight(point, place);
            *sum += f64::from(weight * value);
            *total += f64::from(weight);
        }
    }
    for (value, (sum, total)) in table.iter_mut().zip(sums).filter(|(_, (_, total))| *total > 0.0) {
        *value = (sum / total) as f32;
    }
    table
}

/// Drops unused rows and sorts the others, the most frequent first.
fn sorted(width: usize, rows: &[u32], table: &[f32]) -> Book {
    let mut counts: Vec<(usize, usize)> = (0..table.len() / width).map(|row| (0, row)).collect();
    rows.iter().for_each(|row| counts[*row as usize].0 += 1);
    counts.retain(|(count, _)| *count > 0);
    counts.sort_by_key(|(count, row)| (std::cmp::Reverse(*count), *row));
    let mut places = vec![0u16; table.len() / width];
    for (place, (_, row)) in counts.iter().enumerate() {
        places[*row] = place as u16;
    }
    Book {
        table: counts.iter().flat_map(|(_, row)| &table[row * width..][..width]).copied().collect(),
        rows: rows.iter().map(|row| places[*row as usize]).collect(),
    }
}

/// Returns the best row of every point: the one with the least error plus cost. Ties go to the first.
fn assign(points: &Points, table: &[f32], costs: &[f32], progress: &Progress) -> Result<Vec<u32>, Canceled> {
    // Error plus cost is `w x^2 - 2 (w x y - w y^2 / 2 - cost / 2)`. The sum in brackets is the product of a point and a row
    // that are extended by a few numbers.
    let (others, width) = (points.others, points.width());
    let extended = width + 4;
    let mut search = Vec::with_capacity(costs.len() * extended);
    for (row, cost) in table.chunks_exact(width).zip(costs) {
        search.extend(row);
        search.extend(row.chunks_exact(others).map(|channel| -0.5 * channel.iter().map(|k| k * k).sum::<f32>()));
        search.push(-0.5 * cost);
    }
    let count = points.len();
    let of_lanes = |lanes: usize| {
        progress.check()?;
        let point = |lane: usize| (lanes * LANES + lane).min(count - 1);
        let query = |place: usize, lane: usize| {
            let point = point(lane);
            match place.checked_sub(width) {
                None => points.weight(point, place) * points.value(point)[place],
                Some(channel) => points.weights[point].get(channel).copied().unwrap_or(1.0),
            }
        };
        let queries: Vec<[f32; LANES]> =
            (0..extended).map(|place| std::array::from_fn(|lane| query(place, lane))).collect();
        let mut best = [f32::NEG_INFINITY; LANES];
        let mut found = [0u32; LANES];
        for (row, index) in search.chunks_exact(extended).zip(0..) {
            let mut products = [0.0f32; LANES];
            for (number, query) in row.iter().zip(&queries) {
                for (product, query) in products.iter_mut().zip(query) {
                    *product += number * query;
                }
            }
            for lane in 0..LANES {
                let better = products[lane] > best[lane];
                best[lane] = if better { products[lane] } else { best[lane] };
                found[lane] = if better { index } else { found[lane] };
            }
        }
        Ok(found)
    };
    let rows: Vec<[u32; LANES]> = (0..count.div_ceil(LANES)).into_par_iter().map(of_lanes).collect::<Result<_, _>>()?;
    Ok(rows.into_flattened().into_iter().take(count).collect())
}

/// A part of the points.
struct Part {
    error: f64,
    /// Position of its first point, and the number of points.
    first: usize,
    count: usize,
    /// The coefficient that varies most, and its mean.
    axis: usize,
    mean: f32,
}

impl PartialEq for Part {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Part {}

impl PartialOrd for Part {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Part {
    fn cmp(&self, other: &Self) -> Ordering {
        self.error.total_cmp(&other.error).then(other.first.cmp(&self.first))
    }
}

/// Splits the points into at most `most` parts, always the part with the largest error next, where it varies most. Returns
/// their means, and the part of every point.
fn split(points: &Points, most: usize, progress: &Progress) -> Result<(Vec<f32>, Vec<u32>), Canceled> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    let mut parts = BinaryHeap::from([part(points, &order, 0)]);
    while parts.len() < most {
        progress.check()?;
        let Some(Part { error, first, count, axis, mean }) = parts.pop() else { break };
        let members = &mut order[first..first + count];
        let (low, high): (Vec<usize>, Vec<usize>) =
            members.iter().partition(|point| points.value(**point)[axis] < mean);
        if error <= 0.0 || low.is_empty() || high.is_empty() {
            // Nothing else has a larger error.
            parts.push(Part { error: 0.0, first, count, axis, mean });
            if error <= 0.0 {
                break;
            }
            continue;
        }
        members[..low.len()].copy_from_slice(&low);
        members[low.len()..].copy_from_slice(&high);
        parts.push(part(points, &low, first));
        parts.push(part(points, &high, first + low.len()));
    }
    let mut parts = parts.into_vec();
    parts.sort_by_key(|part| part.first);
    let mut rows = vec![0; points.len()];
    for (index, part) in (0..).zip(&parts) {
        order[part.first..part.first + part.count].iter().for_each(|point| rows[*point] = index);
    }
    Ok((means(points, &rows, vec![0.0; parts.len() * points.width()]), rows))
}

fn part(points: &Points, members: &[usize], first: usize) -> Part {
    let width = points.width();
    let mut sums = vec![[0.0f64; 3]; width];
    for point in members {
        for (place, (sums, value)) in sums.iter_mut().zip(points.value(*point)).enumerate() {
            let (weight, value) = (f64::from(points.weight(*point, place)), f64::from(*value));
            sums[0] += weight;
            sums[1] += weight * value;
            sums[2] += weight * value * value;
        }
    }
    let error = |[total, sum, square]: &[f64; 3]| {
        if *total > 0.0 { (square - sum * sum / total).max(0.0) } else { 0.0 }
    };
    let errors: Vec<f64> = sums.iter().map(error).collect();
    let axis = (0..width).max_by(|a, b| errors[*a].total_cmp(&errors[*b]).then(b.cmp(a))).unwrap_or(0);
    let mean = sums[axis][1] / sums[axis][0].max(f64::MIN_POSITIVE);
    Part { error: errors.iter().sum(), first, count: members.len(), axis, mean: mean as f32 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(values: &[[f32; 3]], weights: &[f32]) -> Points {
        Points {
            others: 1,
            values: values.as_flattened().to_vec(),
            weights: weights.iter().map(|weight| [*weight; 3]).collect(),
        }
    }

    /// If there are as many rows as different points, every point gets its own, however often it occurs.
    #[test]
    fn few_points_are_kept_exactly() {
        let corners: Vec<[f32; 3]> = (0..8).map(|bits| [0, 1, 2].map(|axis| ((bits >> axis) & 1) as f32)).collect();
        let all: Vec<[f32; 3]> = (0..100).map(|index| corners[index * index % 8]).collect();
        let points = points(&all, &[1e6; 100]);
        let book = learn(&points, 8, &Progress::default()).unwrap();
        for (point, row) in all.iter().zip(&book.rows) {
            assert_eq!(book.table[usize::from(*row) * 3..][..3], *point);
        }
        // 0, 1 and 4 are the squares modulo 8. 1 is the most frequent.
        assert_eq!(book.table.len() / 3, 3);
        assert_eq!(book.table[..3], corners[1]);
    }

    /// A row goes where points are seen.
    #[test]
    fn weights_attract_rows() {
        let values: Vec<[f32; 3]> = (0..400).map(|index| [index as f32; 3]).collect();
        let error = |heavy: std::ops::Range<usize>| {
            let weights: Vec<f32> = (0..400).map(|index| if heavy.contains(&index) { 1e3 } else { 1e-3 }).collect();
            let book = learn(&points(&values, &weights), 20, &Progress::default()).unwrap();
            let of = |index: usize| (book.table[usize::from(book.rows[index]) * 3] - index as f32).abs();
            (heavy.clone().map(of).sum::<f32>() / heavy.len() as f32, (0..400).map(of).sum::<f32>() / 400.0)
        };
        for heavy in [0..100, 150..250, 300..400] {
            let (seen, all) = error(heavy);
            assert!(seen < 1.5 && all > 2.0 * seen, "{seen} {all}");
        }
    }

    #[test]
    fn any_number_of_threads_gives_the_same_bits() {
        let values: Vec<[f32; 3]> =
            (0..3000u32).map(|index| [7, 11, 13].map(|prime| (index * index % (prime * 101)) as f32)).collect();
        let points = points(&values, &vec![1.0; 3000]);
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let book = pool.install(|| learn(&points, 64, &Progress::default())).unwrap();
            (book.table, book.rows)
        };
        assert_eq!(on(1), on(3));
    }
}
