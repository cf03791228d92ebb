//! Small dense linear algebra: solutions and inverses by elimination with pivoting.

use crate::simd::{Kernel, Simd, dispatch};

/// Returns the solution of a linear system, or `None` if it is singular. Each row has the coefficients, then the right
/// side.
pub fn solve(mut rows: Vec<Vec<f64>>) -> Option<Vec<f64>> {
    let mut out = vec![0.0; rows.len()];
    eliminate(&mut rows, &mut out);
    out.iter().all(|v| v.is_finite()).then_some(out)
}

/// Solves a system in place and writes the solution to `out`, which is not finite if the system is singular.
pub fn eliminate<R: AsRef<[f64]> + AsMut<[f64]>>(rows: &mut [R], out: &mut [f64]) {
    let size = rows.len();
    let at = |rows: &[R], r: usize, c: usize| rows[r].as_ref()[c];
    for i in 0..size {
        let pivot = (i..size).max_by(|&a, &b| at(rows, a, i).abs().total_cmp(&at(rows, b, i).abs())).unwrap_or(i);
        rows.swap(i, pivot);
        let (done, rest) = rows.split_at_mut(i + 1);
        let lead = done[i].as_ref();
        for row in rest {
            let row = row.as_mut();
            let factor = row[i] / lead[i];
            if factor != 0.0 {
                for c in i..=size {
                    row[c] -= factor * lead[c];
                }
            }
        }
    }
    for i in (0..size).rev() {
        let known: f64 = (i + 1..size).map(|c| at(rows, i, c) * out[c]).sum();
        out[i] = (at(rows, i, size) - known) / at(rows, i, i);
    }
}

/// Inverts a square matrix in place (row by row, `size` rows) by Gauss-Jordan elimination with row pivoting. Returns whether
/// it is regular to rounding; if not, the contents are useless.
pub fn invert(matrix: &mut [f64], size: usize) -> bool {
    dispatch(Invert { matrix, size })
}

struct Invert<'a> {
    matrix: &'a mut [f64],
    size: usize,
}

impl Kernel for Invert<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> bool {
        gauss_jordan(self.matrix, self.size)
    }
}

#[inline(always)]
fn gauss_jordan(matrix: &mut [f64], size: usize) -> bool {
    let mut swaps = Vec::with_capacity(size);
    let mut pivot_row = vec![0.0; size];
    for k in 0..size {
        let magnitude = |r: usize| matrix[r * size + k].abs();
        let pivot = (k..size).max_by(|&a, &b| magnitude(a).total_cmp(&magnitude(b))).unwrap_or(k);
        let value = matrix[pivot * size + k];
        if value == 0.0 || !value.is_finite() {
            return false;
        }
        swaps.push(pivot);
        if pivot != k {
            let (low, high) = matrix.split_at_mut(pivot * size);
            low[k * size..(k + 1) * size].swap_with_slice(&mut high[..size]);
        }
        let row = &mut matrix[k * size..(k + 1) * size];
        row[k] = 1.0;
        let inverse = 1.0 / value;
        for entry in row.iter_mut() {
            *entry *= inverse;
        }
        pivot_row.copy_from_slice(row);
        let pivot_row = &pivot_row[..size];
        for r in 0..size {
            if r == k {
                continue;
            }
            let row = &mut matrix[r * size..][..size];
            let factor = row[k];
            row[k] = 0.0;
            for c in 0..size {
                row[c] -= factor * pivot_row[c];
            }
        }
    }
    for (k, &pivot) in swaps.iter().enumerate().rev() {
        if pivot != k {
            for row in matrix.chunks_exact_mut(size) {
                row.swap(k, pivot);
            }
        }
    }
    matrix.iter().all(|v| v.is_finite())
}

/// Writes the product of a square matrix, column by column, with a vector to `out`; their size is a multiple of three.
pub fn multiply(columns: &[f64], vector: &[f64], out: &mut [f64]) {
    dispatch(Product { columns, vector, out });
}

/// Compiles [`multiply`] for the machine's vector instructions.
struct Product<'a> {
    columns: &'a [f64],
    vector: &'a [f64],
    out: &'a mut [f64],
}

impl Kernel for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let size = self.out.len();
        self.out.fill(0.0);
        // Three columns at once: `out` is read and written less often.
        for (columns, x) in self.columns.chunks_exact(3 * size).zip(self.vector.chunks_exact(3)) {
            let (a, rest) = columns.split_at(size);
            let (b, c) = rest.split_at(size);
            for (((out, a), b), c) in self.out.iter_mut().zip(a).zip(b).zip(c) {
                *out += a * x[0] + b * x[1] + c * x[2];
            }
        }
    }
}
