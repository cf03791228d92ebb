//! The Cholesky factorisation of a large symmetric matrix, by blocks of columns: nearly all of it is matrix products.

use nalgebra::DMatrix;

/// Columns of a block.
const BLOCK: usize = 96;

/// Factors the damped normal matrix N = A^T A + d 1 = L L^T, with A = `of`. Returns X = `rows` L^-T, for which X X^T =
/// `rows` N^-1 `rows`^T. `damping`: d relative to the mean of N's diagonal. `None` when N is not positive definite to
/// rounding.
pub fn whiten(of: &DMatrix<f64>, rows: &DMatrix<f64>, damping: f64) -> Option<DMatrix<f64>> {
    let size = of.ncols();
    let damping = damping * of.norm_squared() / size as f64;
    // The library's product with a transpose is far slower than its product with a copy of the transpose.
    let across = of.transpose();
    // N (only its lower half is used) above the rows.
    let mut matrix = DMatrix::zeros(size + rows.nrows(), size);
    matrix.rows_mut(size, rows.nrows()).copy_from(rows);
    for start in (0..size).step_by(BLOCK) {
        let end = (start + BLOCK).min(size);
        let (done, mut rest) = matrix.columns_range_pair_mut(..start, start..end);
        rest.rows_range_mut(start..size).gemm(1.0, &across.rows_range(start..), &of.columns_range(start..end), 0.0);
        rest.rows_range_mut(start..).gemm(
            -1.0,
            &done.rows_range(start..),
            &done.rows_range(start..end).transpose(),
            1.0,
        );
        let mut pivot = rest.rows_range(start..end).into_owned();
        pivot.set_diagonal(&pivot.diagonal().add_scalar(damping));
        let lower = pivot.cholesky()?.unpack();
        let inverse = lower.solve_lower_triangular(&DMatrix::identity(end - start, end - start))?;
        let below = rest.rows_range(end..) * inverse.transpose();
        rest.rows_range_mut(end..).copy_from(&below);
        rest.rows_range_mut(start..end).copy_from(&lower);
    }
    Some(matrix.rows(size, rows.nrows()).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_results_make_the_product_with_the_inverse() {
        for size in [1, BLOCK - 1, BLOCK, 2 * BLOCK + 7] {
            let of = DMatrix::from_fn(size + 3, size, |i, j| {
                ((i * 37 + j * 101) % 53) as f64 / 53.0 + if i == j { 3.0 } else { 0.0 }
            });
            let rows = DMatrix::from_fn(4, size, |i, j| ((i * 11 + j * 7) % 13) as f64);
            let mut normal = of.transpose() * &of;
            normal += DMatrix::identity(size, size) * (0.01 * normal.trace() / size as f64);
            let want = &rows * normal.cholesky().expect("positive").solve(&rows.transpose());
            let half = whiten(&of, &rows, 0.01).expect("positive");
            assert!((&half * half.transpose() - &want).norm() < 1e-12 * want.norm(), "{size}");
        }
    }

    #[test]
    fn a_matrix_with_a_zero_column_has_no_factor() {
        let mut of = DMatrix::identity(3, 3);
        of[(1, 1)] = 0.0;
        assert!(whiten(&of, &DMatrix::identity(3, 3), 0.0).is_none());
    }
}
