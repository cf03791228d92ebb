//! Products of matrices for nalgebra, with the same bits on every processor.
//!
//! nalgebra leaves products of large matrices to the library `matrixmultiply`, whose kernels are chosen by the processor
//! and sum in different orders. The workspace replaces it by this crate (`[patch]` in `Cargo.toml`). Each entry is one sum in
//! order, and products and sums are rounded separately: the vector instructions that compute it do not matter.
#![allow(clippy::too_many_arguments, clippy::needless_range_loop)]

use pulp::{Arch, Simd, WithSimd};

/// Rows of a panel of the left matrix: a multiple of every vector width.
const ROWS: usize = 8;
/// Columns of a panel of the right matrix; more sums are too many for the registers.
const COLUMNS: usize = 4;

/// Computes C = `alpha` A B + `beta` C; with `beta` 0, C is only written. A has `m` rows and `k` columns, B has `n` columns;
/// entry (i, j) of a matrix is at `i * rs + j * cs`.
///
/// # Safety
/// All entries are within the matrices, and C overlaps no other one.
pub unsafe fn dgemm(
    m: usize,
    k: usize,
    n: usize,
    alpha: f64,
    a: *const f64,
    rsa: isize,
    csa: isize,
    b: *const f64,
    rsb: isize,
    csb: isize,
    beta: f64,
    c: *mut f64,
    rsc: isize,
    csc: isize,
) {
    // SAFETY: the caller's entries.
    let rows = unsafe { pack::<ROWS>(m, k, a, [rsa, csa]) };
    // SAFETY: likewise.
    let columns = unsafe { pack::<COLUMNS>(n, k, b, [csb, rsb]) };
    let mut product = vec![0.0; m.div_ceil(ROWS) * ROWS * n.div_ceil(COLUMNS) * COLUMNS];
    if k > 0 {
        Arch::new().dispatch(Product { rows: &rows, columns: &columns, terms: k, out: &mut product });
    }
    for j in 0..n {
        for i in 0..m {
            let panel = i / ROWS * n.div_ceil(COLUMNS) + j / COLUMNS;
            let value = alpha * product[(panel * COLUMNS + j % COLUMNS) * ROWS + i % ROWS];
            // SAFETY: likewise.
            let entry = unsafe { c.offset(i as isize * rsc + j as isize * csc) };
            // SAFETY: likewise; without `beta`, the entry is not read.
            unsafe { entry.write(if beta == 0.0 { value } else { value + beta * *entry }) };
        }
    }
}

// What nalgebra and the Python module's arrays can ask for, and nothing here does.
macro_rules! other {
    ($name:ident, $number:ty, $zero:expr, $add:expr, $multiply:expr $(, $flag:ident)*) => {
        /// Computes the same as [`dgemm`] for other numbers.
        ///
        /// # Safety
        /// As for [`dgemm`].
        pub unsafe fn $name(
            $($flag: CGemmOption,)*
            m: usize,
            k: usize,
            n: usize,
            alpha: $number,
            a: *const $number,
            rsa: isize,
            csa: isize,
            b: *const $number,
            rsb: isize,
            csb: isize,
            beta: $number,
            c: *mut $number,
            rsc: isize,
            csc: isize,
        ) {
            $(let CGemmOption::Standard = $flag;)*
            let [m, k, n] = [m, k, n].map(|count| count as isize);
            for (i, j) in (0..m).flat_map(|i| (0..n).map(move |j| (i, j))) {
                // SAFETY: the caller's entries.
                let term = |p: isize| unsafe { $multiply(*a.offset(i * rsa + p * csa), *b.offset(p * rsb + j * csb)) };
                let value = $multiply(alpha, (0..k).map(term).fold($zero, $add));
                // SAFETY: likewise.
                let entry = unsafe { c.offset(i * rsc + j * csc) };
                // SAFETY: likewise; without `beta`, the entry is not read.
                unsafe { entry.write(if beta == $zero { value } else { $add(value, $multiply(beta, *entry)) }) };
            }
        }
    };
}

/// What is done to a complex matrix first: nothing.
#[derive(Clone, Copy, Debug)]
pub enum CGemmOption {
    /// Nothing.
    Standard,
}

macro_rules! complex {
    ($name:ident, $part:ty) => {
        other!(
            $name,
            [$part; 2],
            [0.0; 2],
            |[a, b]: [$part; 2], [c, d]: [$part; 2]| [a + c, b + d],
            |[a, b]: [$part; 2], [c, d]: [$part; 2]| [a * c - b * d, a * d + b * c],
            _flag_a,
            _flag_b
        );
    };
}

other!(sgemm, f32, 0.0, |a: f32, b: f32| a + b, |a: f32, b: f32| a * b);
complex!(cgemm, f32);
complex!(zgemm, f64);

/// Returns the lines of a matrix in panels of `WIDTH`, the last one padded with zeros; within a panel, term by term. `strides`:
/// from line to line and from term to term.
///
/// # Safety
/// All entries are within the matrix.
unsafe fn pack<const WIDTH: usize>(lines: usize, terms: usize, from: *const f64, strides: [isize; 2]) -> Vec<f64> {
    let mut packed = vec![0.0; lines.div_ceil(WIDTH) * WIDTH * terms];
    let panels = packed.chunks_exact_mut((WIDTH * terms).max(1));
    for (first, panel) in (0..lines).step_by(WIDTH).zip(panels) {
        for term in 0..terms {
            for line in 0..WIDTH.min(lines - first) {
                let at = (first + line) as isize * strides[0] + term as isize * strides[1];
                // SAFETY: the caller's entries.
                panel[term * WIDTH + line] = unsafe { *from.offset(at) };
            }
        }
    }
    packed
}

/// Products of all panels, column by column, in order of the left panels.
struct Product<'a> {
    rows: &'a [f64],
    columns: &'a [f64],
    terms: usize,
    out: &'a mut [f64],
}

impl WithSimd for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let registers = ROWS / S::F64_LANES;
        let out = S::as_mut_simd_f64s(self.out).0;
        let mut at = 0;
        for rows in self.rows.chunks_exact(ROWS * self.terms) {
            for columns in self.columns.chunks_exact(COLUMNS * self.terms) {
                // As many sums as the narrowest registers need: of one lane.
                let mut sums = [[simd.splat_f64s(0.0); ROWS]; COLUMNS];
                let rows = S::as_simd_f64s(rows).0;
                // Spelled out: iterators would be compiled without the vector instructions.
                for term in 0..self.terms {
                    let (row, column) = (&rows[term * registers..][..registers], &columns[term * COLUMNS..][..COLUMNS]);
                    for c in 0..COLUMNS {
                        let factor = simd.splat_f64s(column[c]);
                        for r in 0..registers {
                            sums[c][r] = simd.add_f64s(sums[c][r], simd.mul_f64s(row[r], factor));
                        }
                    }
                }
                // Spelled out: a slice of the sums would keep them in memory.
                for c in 0..COLUMNS {
                    for r in 0..registers {
                        out[at] = sums[c][r];
                        at += 1;
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, Scalar};

    fn matrix<T: Scalar + From<i8>>(rows: usize, columns: usize, step: usize) -> DMatrix<T> {
        DMatrix::from_fn(rows, columns, |i, j| T::from(((1 + i * 7 + j * step) % 23) as i8))
    }

    #[test]
    fn products_of_every_size_are_right() {
        for (m, k, n) in [(6, 6, 6), (7, 9, 8), (8, 16, 12), (25, 40, 13), (1, 7, 9)] {
            // Whole numbers: sums are exact.
            let (a, b, c) = (matrix::<f64>(m, k, 5), matrix::<f64>(k, n, 11), matrix::<f64>(m, n, 3));
            let want = DMatrix::from_fn(m, n, |i, j| (0..k).map(|p| a[(i, p)] * b[(p, j)]).sum::<f64>());
            assert_eq!(&a * &b, want);
            assert_eq!(a.map(|v| v as f32) * b.map(|v| v as f32), want.map(|v| v as f32));
            // Views of larger matrices, and sums.
            let mut out = DMatrix::zeros(m + 2, n + 3);
            out.view_mut((2, 3), (m, n)).copy_from(&c);
            out.view_mut((2, 3), (m, n)).gemm(-2.0, &a, &b, 3.0);
            assert_eq!(out.view((2, 3), (m, n)), c * 3.0 - want * 2.0);
        }
    }
}
