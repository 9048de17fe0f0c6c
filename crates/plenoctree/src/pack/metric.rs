//! The visible effect of errors in a leaf's coefficients.

use std::f32::consts::PI;

use half::f16;

use crate::cholesky;

/// The share of a leaf's views that may come from any direction, because few directions are sampled, and because rays
/// also pass next to its center.
const ANYWHERE: f32 = 0.3;

/// The values of the basis functions in all directions, and their products.
pub(super) struct Metric {
    others: usize,
    /// For each direction, all functions except the constant one, then the products of all pairs of them.
    directions: Vec<Vec<f32>>,
}

impl Metric {
    pub fn new(directions: &[[f32; 25]], functions: usize) -> Self {
        let others = functions - 1;
        let of_direction = |y: &[f32; 25]| {
            let y = &y[1..functions];
            y.iter().copied().chain(pairs(others).map(|(a, b)| y[a] * y[b])).collect()
        };
        Self { others, directions: directions.iter().map(of_direction).collect() }
    }

    /// Returns the number of functions without the constant one.
    pub fn others(&self) -> usize {
        self.others
    }

    /// Returns the means of the functions over the views of a leaf, and then their covariances, one for each pair, in
    /// units of the mean square of the constant function.
    ///
    /// The covariances say how large an error is if the coefficient of the constant function makes its mean vanish.
    pub fn of(&self, views: &[f16], moments: &mut Vec<f32>) {
        moments.clear();
        moments.resize(self.others + pairs(self.others).count(), 0.0);
        for (view, direction) in views.iter().zip(&self.directions).filter(|(view, _)| **view != f16::ZERO) {
            let view = view.to_f32();
            for (sum, value) in moments.iter_mut().zip(direction) {
                *sum += view * value;
            }
        }
        let (means, covariances) = moments.split_at_mut(self.others);
        means.iter_mut().for_each(|mean| *mean *= 1.0 - ANYWHERE);
        for (covariance, (a, b)) in covariances.iter_mut().zip(pairs(self.others)) {
            let anywhere = if a == b { ANYWHERE } else { 0.0 };
            let square = (1.0 - ANYWHERE) * *covariance * (4.0 * PI) + anywhere;
            *covariance = square - means[a] * means[b] * (4.0 * PI);
        }
    }
}

/// Returns all pairs of `0..count`, including those of a number with itself.
pub(super) fn pairs(count: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..count).flat_map(move |a| (a..count).map(move |b| (a, b)))
}

/// Returns the product of a symmetric matrix, given as its [`pairs`], and a vector.
pub(super) fn product(matrix: &[f32], vector: &[f32], result: &mut [f32]) {
    result.fill(0.0);
    for (number, (a, b)) in matrix.iter().zip(pairs(vector.len())) {
        result[a] += number * vector[b];
        if a != b {
            result[b] += number * vector[a];
        }
    }
}

/// Solves `matrix x = vector` in place. The matrix is symmetric and positive, and given as its [`pairs`].
pub(super) fn solve(matrix: &[f64], vector: &mut [f64]) {
    let count = vector.len();
    let mut l = vec![0.0; count * count];
    for (number, (a, b)) in matrix.iter().zip(pairs(count)) {
        l[b * count + a] = *number;
    }
    cholesky::decompose(&mut l, count);
    cholesky::solve(&l, vector);
}

/// Adds a number to the diagonal of a symmetric matrix, given as its [`pairs`].
pub(super) fn add_diagonal(matrix: &mut [f64], count: usize, number: f64) {
    let mut place = 0;
    for row in 0..count {
        matrix[place] += number;
        place += count - row;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solutions_are_solutions() {
        let matrix = [4.0, 1.0, -1.0, 3.0, 0.5, 5.0];
        let mut x = [1.0, -2.0, 7.0];
        solve(&matrix, &mut x);
        let mut back = [0.0; 3];
        product(&matrix.map(|number| number as f32), &x.map(|x| x as f32), &mut back);
        for (back, expected) in back.iter().zip([1.0, -2.0, 7.0]) {
            assert!((back - expected).abs() < 1e-5, "{back:?}");
        }
    }

    /// An error that all views of a leaf share counts little, because the constant function compensates for it.
    #[test]
    fn what_all_views_share_counts_little() {
        let [mut a, mut b] = [[0.0; 25]; 2];
        (a[1], a[2]) = (0.5, 0.5);
        (b[1], b[2]) = (0.5, -0.5);
        let metric = Metric::new(&[a, b], 4);
        let mut moments = Vec::new();
        metric.of(&[f16::from_f32(0.5); 2], &mut moments);
        assert_eq!(moments[..3], [0.35, 0.0, 0.0]);
        let [shared, differs] = [moments[3], moments[6]];
        assert!((differs - (0.7 * 0.25 * 4.0 * PI + 0.3)).abs() < 1e-5, "{moments:?}");
        assert!(shared < 0.4 * differs, "{moments:?}");
    }
}
