//! Factors of a square matrix in single precision by blocks: a sixth of the work of its inverse.
//!
//! A = L U with whole blocks for pivots: L has unit blocks on its diagonal, U the pivots. Rows are exchanged within a pivot
//! only, so each pivot must be regular: in [`super::preconditioner`], a pivot belongs to neighbouring nodes.

use crate::linear::invert;
use crate::simd::{Kernel, Simd, dispatch};
use std::ops::Range;

/// Rows and columns of a block: a multiple of every vector width.
const BLOCK: usize = 16;
/// Columns that one pass over a vector subtracts; more are too many for the registers.
const PASS: usize = 8;

/// A block, column by column.
type Block = [f32; BLOCK * BLOCK];

/// Factors of a matrix.
#[derive(Clone, Debug)]
pub struct Factors {
    /// Rows with their padding.
    size: usize,
    /// Column by column: L below the pivots, U above.
    values: Vec<f32>,
    /// Inverses of the pivots.
    pivots: Vec<Block>,
}

impl Factors {
    /// Returns the number of rows and columns with their padding.
    pub fn padded(size: usize) -> usize {
        size.div_ceil(BLOCK) * BLOCK
    }

    /// Returns the factors of a matrix of `size` rows, column by column, both padded to [`Factors::padded`]; `None` when a
    /// pivot is singular to rounding.
    pub fn new(mut matrix: Vec<f32>, size: usize) -> Option<Self> {
        let padded = Self::padded(size);
        for k in size..padded {
            matrix[k * padded + k] = 1.0;
        }
        let mut factors = Self { size: padded, values: matrix, pivots: Vec::with_capacity(padded / BLOCK) };
        dispatch(Factor(&mut factors)).then_some(factors)
    }

    /// Replaces vectors by the solutions for them. The vectors follow one another, each padded with zeros.
    pub fn solve(&self, vectors: &mut [f32]) {
        // Several at once hide each other's latency; more than three are too many for the registers.
        for vectors in vectors.chunks_mut(3 * self.size) {
            match vectors.len() / self.size {
                3 => dispatch(Solve::<3> { factors: self, vectors }),
                2 => dispatch(Solve::<2> { factors: self, vectors }),
                _ => dispatch(Solve::<1> { factors: self, vectors }),
            }
        }
    }

    #[inline(always)]
    fn factor<S: Simd>(&mut self, simd: S) -> bool {
        let size = self.size;
        for start in (0..size).step_by(BLOCK) {
            let (done, rest) = self.values.split_at_mut((start + BLOCK) * size);
            let columns = &mut done[start * size..];
            let Some(inverse) = invert_pivot(columns, size, start) else {
                return false;
            };
            divide(simd, columns, size, start + BLOCK, &inverse);
            self.pivots.push(inverse);
            for column in rest.chunks_exact_mut(size) {
                let rows = read::<1>(column, start);
                subtract(simd, columns, start + BLOCK..size, &rows, column);
            }
        }
        true
    }

    #[inline(always)]
    fn substitute<S: Simd, const K: usize>(&self, simd: S, vectors: &mut [f32]) {
        let size = self.size;
        let columns = |start: usize| &self.values[start * size..(start + BLOCK) * size];
        for start in (0..size).step_by(BLOCK) {
            let rows = read::<K>(vectors, start);
            subtract(simd, columns(start), start + BLOCK..size, &rows, vectors);
        }
        for (block, inverse) in self.pivots.iter().enumerate().rev() {
            let start = block * BLOCK;
            let rows = read::<K>(vectors, start).map(|rows| multiply(inverse, &rows));
            for (vector, rows) in vectors.chunks_exact_mut(size).zip(&rows) {
                vector[start..start + BLOCK].copy_from_slice(rows);
            }
            subtract(simd, columns(start), 0..start, &rows, vectors);
        }
    }
}

/// Returns the inverse of a pivot.
fn invert_pivot(columns: &[f32], size: usize, start: usize) -> Option<Block> {
    let mut pivot = [0.0; BLOCK * BLOCK];
    for (entries, column) in pivot.chunks_exact_mut(BLOCK).zip(columns.chunks_exact(size)) {
        for (entry, value) in entries.iter_mut().zip(&column[start..]) {
            *entry = f64::from(*value);
        }
    }
    // The entries are stored column by column: inverting the transpose gives the transpose of the inverse.
    invert(&mut pivot, BLOCK).then(|| pivot.map(|entry| entry as f32))
}

/// Multiplies the columns of a block, from row `from` on, by a matrix from the right.
#[inline(always)]
fn divide<S: Simd>(simd: S, columns: &mut [f32], size: usize, from: usize, by: &Block) {
    let (lanes, stride) = (S::as_mut_simd_f32s(columns).0, size / S::F32_LANES);
    for i in from / S::F32_LANES..stride {
        let mut row = [simd.splat_f32s(0.0); BLOCK];
        for q in 0..BLOCK {
            row[q] = lanes[q * stride + i];
        }
        for (p, factors) in by.chunks_exact(BLOCK).enumerate() {
            let mut sums = [simd.splat_f32s(0.0); 2];
            for q in 0..BLOCK {
                sums[q % 2] = simd.fused_f32s(row[q], simd.splat_f32s(factors[q]), sums[q % 2]);
            }
            lanes[p * stride + i] = simd.add_f32s(sums[0], sums[1]);
        }
    }
}

/// Returns a block's rows of some vectors.
#[inline(always)]
fn read<const K: usize>(vectors: &[f32], start: usize) -> [[f32; BLOCK]; K] {
    let size = vectors.len() / K;
    let mut rows = [[0.0; BLOCK]; K];
    for (rows, vector) in rows.iter_mut().zip(vectors.chunks_exact(size)) {
        rows.copy_from_slice(&vector[start..start + BLOCK]);
    }
    rows
}

#[inline(always)]
fn multiply(block: &Block, rows: &[f32; BLOCK]) -> [f32; BLOCK] {
    let mut sums = [[0.0; BLOCK]; 4];
    for (p, column) in block.chunks_exact(BLOCK).enumerate() {
        for r in 0..BLOCK {
            sums[p % 4][r] += column[r] * rows[p];
        }
    }
    let mut product = [0.0; BLOCK];
    for r in 0..BLOCK {
        product[r] = (sums[0][r] + sums[1][r]) + (sums[2][r] + sums[3][r]);
    }
    product
}

/// Subtracts multiples of the columns of a block from some rows of vectors. The range covers whole blocks.
#[inline(always)]
fn subtract<S: Simd, const K: usize>(
    simd: S,
    columns: &[f32],
    rows: Range<usize>,
    by: &[[f32; BLOCK]; K],
    vectors: &mut [f32],
) {
    let size = vectors.len() / K;
    let (first, last) = (rows.start / S::F32_LANES, rows.end / S::F32_LANES);
    for pass in (0..BLOCK).step_by(PASS) {
        // Spelled out: a closure would be compiled without the vector instructions.
        let mut lanes = [S::as_simd_f32s(&columns[..0]).0; PASS];
        let mut factors = [[simd.splat_f32s(0.0); PASS]; K];
        for p in 0..PASS {
            lanes[p] = &S::as_simd_f32s(&columns[(pass + p) * size..][..size]).0[first..last];
            for k in 0..K {
                factors[k][p] = simd.splat_f32s(-by[k][pass + p]);
            }
        }
        let mut out: [&mut [S::f32s]; K] = std::array::from_fn(|_| Default::default());
        for (out, vector) in out.iter_mut().zip(vectors.chunks_exact_mut(size)) {
            *out = &mut S::as_mut_simd_f32s(vector).0[first..last];
        }
        for i in 0..last - first {
            for k in 0..K {
                let (mut even, mut odd) = (out[k][i], simd.splat_f32s(0.0));
                for p in 0..PASS / 2 {
                    even = simd.fused_f32s(lanes[2 * p][i], factors[k][2 * p], even);
                    odd = simd.fused_f32s(lanes[2 * p + 1][i], factors[k][2 * p + 1], odd);
                }
                out[k][i] = simd.add_f32s(even, odd);
            }
        }
    }
}

/// Compiles the factorisation for the machine's vector instructions.
struct Factor<'a>(&'a mut Factors);

impl Kernel for Factor<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> bool {
        self.0.factor(simd)
    }
}

/// Compiles the substitution for the machine's vector instructions.
struct Solve<'a, const K: usize> {
    factors: &'a Factors,
    vectors: &'a mut [f32],
}

impl<const K: usize> Kernel for Solve<'_, K> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        self.factors.substitute::<S, K>(simd, self.vectors);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solutions_satisfy_their_equations() {
        for size in [1usize, 7, 8, 16, 50, 99, 198] {
            let stride = Factors::padded(size);
            // Within a block, pivots lie off the diagonal.
            let entry = |r: usize, c: usize| {
                ((r * 37 + c * 101) % 53) as f32 / 53.0
                    + if r ^ 1 == c || (r == c && r + 1 == size && size % 2 == 1) { 9.0 } else { 0.0 }
            };
            let mut matrix = vec![0.0; stride * stride];
            for q in 0..size * size {
                matrix[(q % size) * stride + q / size] = entry(q / size, q % size);
            }
            let factors = Factors::new(matrix, size).expect("a regular matrix");
            for count in 1..6 {
                let mut vectors = vec![0.0; count * stride];
                for (k, vector) in vectors.chunks_exact_mut(stride).enumerate() {
                    for (r, v) in vector[..size].iter_mut().enumerate() {
                        *v = (0..size).map(|c| entry(r, c) * (c as f32 - k as f32)).sum();
                    }
                }
                factors.solve(&mut vectors);
                for (k, vector) in vectors.chunks_exact(stride).enumerate() {
                    for (c, v) in vector.iter().enumerate() {
                        let want = if c < size { c as f32 - k as f32 } else { 0.0 };
                        assert!((v - want).abs() < 2e-3, "{size} {k} {c} {v} {want}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_singular_matrix_has_no_factors() {
        let stride = Factors::padded(3);
        assert!(Factors::new(vec![0.0; stride * stride], 3).is_none());
    }
}
