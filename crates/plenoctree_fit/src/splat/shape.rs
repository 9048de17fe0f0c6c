//! The axes of ellipsoids.

use glam::{DMat3, DVec3};

/// Returns the axes and half-widths of the ellipsoid that `shape` makes of the unit ball: the eigenvectors of `shape
/// shape^T`, by Jacobi's rotations, and the roots of its eigenvalues.
pub fn principal(shape: DMat3) -> (DMat3, DVec3) {
    let mut matrix = shape * shape.transpose();
    let mut axes = DMat3::IDENTITY;
    for _ in 0..12 {
        for (a, b) in [(0, 1), (0, 2), (1, 2)] {
            let (off, difference) = (matrix.col(b)[a], matrix.col(b)[b] - matrix.col(a)[a]);
            if off == 0.0 {
                continue;
            }
            let cotangent = difference / (2.0 * off);
            let tangent = 1.0 / (cotangent.abs() + (cotangent * cotangent + 1.0).sqrt()).copysign(cotangent);
            let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
            let sine = tangent * cosine;
            let mut turn = DMat3::IDENTITY;
            turn.col_mut(a)[a] = cosine;
            turn.col_mut(b)[b] = cosine;
            turn.col_mut(b)[a] = sine;
            turn.col_mut(a)[b] = -sine;
            matrix = turn.transpose() * matrix * turn;
            axes *= turn;
        }
    }
    let squares = DVec3::new(matrix.x_axis.x, matrix.y_axis.y, matrix.z_axis.z);
    (axes, squares.max(DVec3::ZERO).map(f64::sqrt))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// The axes and widths describe the ellipsoid of the matrix.
        #[test]
        fn axes_and_widths_make_the_same_ellipsoid(entries in prop::array::uniform9(-2.0f64..2.0)) {
            let shape = DMat3::from_cols_array(&entries);
            let (axes, widths) = principal(shape);
            let again = axes * DMat3::from_diagonal(widths * widths) * axes.transpose();
            let difference = (again - shape * shape.transpose()).to_cols_array();
            prop_assert!(difference.iter().all(|x| x.abs() < 1e-9), "{difference:?}");
            let skew = (axes * axes.transpose() - DMat3::IDENTITY).to_cols_array();
            prop_assert!(skew.iter().all(|x| x.abs() < 1e-9));
        }
    }
}
