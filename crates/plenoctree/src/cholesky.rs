//! Solves systems of linear equations whose matrices are symmetric and positive.

/// Replaces the lower triangle of a matrix, given by its rows, by `l` with `l l^T = matrix`. Nothing else of it is
/// read. Returns the smallest square on the diagonal of `l`, which is about zero if the matrix is singular.
pub(crate) fn decompose(matrix: &mut [f64], count: usize) -> f64 {
    let mut least = f64::INFINITY;
    for a in 0..count {
        for b in a..count {
            let sum: f64 = (0..a).map(|k| matrix[a * count + k] * matrix[b * count + k]).sum();
            let rest = matrix[b * count + a] - sum;
            if a == b {
                least = least.min(rest);
                matrix[a * count + a] = rest.max(1e-30).sqrt();
            } else {
                matrix[b * count + a] = rest / matrix[a * count + a];
            }
        }
    }
    least
}

/// Solves `l l^T x = values` in place, with what [`decompose`] leaves.
pub(crate) fn solve(l: &[f64], values: &mut [f64]) {
    let count = values.len();
    for a in 0..count {
        let sum: f64 = (0..a).map(|k| l[a * count + k] * values[k]).sum();
        values[a] = (values[a] - sum) / l[a * count + a];
    }
    for a in (0..count).rev() {
        let sum: f64 = (a + 1..count).map(|k| l[k * count + a] * values[k]).sum();
        values[a] = (values[a] - sum) / l[a * count + a];
    }
}
