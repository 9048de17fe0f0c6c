//! Splits points into parts, as rows to start from.

use std::{cmp::Reverse, collections::BinaryHeap};

use half::f16;

use crate::sampling::{Canceled, Progress};

/// Points with a weight each.
pub(super) struct Points {
    /// The number of values of a point.
    pub width: usize,
    pub values: Vec<f32>,
    pub weights: Vec<f32>,
}

impl Points {
    fn value(&self, point: usize) -> &[f32] {
        &self.values[point * self.width..][..self.width]
    }
}

/// Returns at most `most` colors, and the index of the one that stands for each given color. Colors stay exact if there
/// are no more than that.
pub(crate) fn shared(colors: &[[f16; 3]], most: usize) -> (Vec<[f16; 3]>, Vec<u16>) {
    if colors.is_empty() {
        return (Vec::new(), Vec::new());
    }
    let values = colors.as_flattened().iter().map(|k| k.to_f32()).collect();
    let points = Points { width: 3, values, weights: vec![1.0; colors.len()] };
    // Not canceled.
    let (table, rows) = split(&points, most, &Progress::default()).unwrap_or_default();
    let table = table.chunks_exact(3).map(|color| [0, 1, 2].map(|channel| f16::from_f32(color[channel])));
    (table.collect(), rows.into_iter().map(|row| row as u16).collect())
}

/// A part of the points.
struct Part {
    error: f64,
    /// Position of its first point, and the number of points.
    first: usize,
    count: usize,
    /// The value that varies most, and its mean.
    axis: usize,
    mean: f32,
}

/// Splits the points into at most `most` parts: always the part with the largest error, where it varies most.
/// Returns their means, and the part of every point.
pub(super) fn split(points: &Points, most: usize, progress: &Progress) -> Result<(Vec<f32>, Vec<u32>), Canceled> {
    let mut order: Vec<usize> = (0..points.weights.len()).collect();
    let mut parts = vec![part(points, &order, 0)];
    // What may be split, by error. Errors are not negative, so that their bits are in the same order.
    let rank = |parts: &[Part], index: usize| (parts[index].error.to_bits(), Reverse(parts[index].first), index);
    let mut open = BinaryHeap::from([rank(&parts, 0)]);
    while parts.len() < most
        && let Some((_, _, index)) = open.pop()
    {
        progress.check()?;
        let Part { error, first, count, axis, mean } = parts[index];
        if error <= 0.0 {
            break;
        }
        let members = &mut order[first..first + count];
        let (low, high): (Vec<usize>, Vec<usize>) =
            members.iter().partition(|point| points.value(**point)[axis] < mean);
        if low.is_empty() || high.is_empty() {
            continue;
        }
        members[..low.len()].copy_from_slice(&low);
        members[low.len()..].copy_from_slice(&high);
        parts[index] = part(points, &low, first);
        parts.push(part(points, &high, first + low.len()));
        open.extend([index, parts.len() - 1].map(|index| rank(&parts, index)));
    }
    parts.sort_by_key(|part| part.first);
    let mut rows = vec![0; points.weights.len()];
    let mut means = Vec::with_capacity(parts.len() * points.width);
    for (index, part) in (0..).zip(&parts) {
        let members = &order[part.first..part.first + part.count];
        members.iter().for_each(|point| rows[*point] = index);
        means.extend(sums(points, members).iter().map(|[total, sum, _]| (sum / total.max(f64::MIN_POSITIVE)) as f32));
    }
    Ok((means, rows))
}

/// Returns the sums of the weights of these points, and of their values and squared values, weighted.
fn sums(points: &Points, members: &[usize]) -> Vec<[f64; 3]> {
    let mut sums = vec![[0.0; 3]; points.width];
    for point in members {
        let weight = f64::from(points.weights[*point]);
        for (sums, value) in sums.iter_mut().zip(points.value(*point)) {
            let value = f64::from(*value);
            sums[0] += weight;
            sums[1] += weight * value;
            sums[2] += weight * value * value;
        }
    }
    sums
}

fn part(points: &Points, members: &[usize], first: usize) -> Part {
    let error = |[total, sum, square]: &[f64; 3]| {
        if *total > 0.0 { (square - sum * sum / total).max(0.0) } else { 0.0 }
    };
    let sums = sums(points, members);
    let errors: Vec<f64> = sums.iter().map(error).collect();
    let axis = (0..points.width).max_by(|a, b| errors[*a].total_cmp(&errors[*b]).then(b.cmp(a))).unwrap_or(0);
    let mean = sums[axis][1] / sums[axis][0].max(f64::MIN_POSITIVE);
    Part { error: errors.iter().sum(), first, count: members.len(), axis, mean: mean as f32 }
}
