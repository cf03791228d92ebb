//! A fast single-precision product of a dense matrix with one or several vectors.

use crate::simd::{Kernel, Simd, dispatch};

/// Rows of a panel: a multiple of every vector width.
const PANEL: usize = 32;

/// A square matrix in single precision, laid out so that a product reads it once, in order.
#[derive(Clone, Debug)]
pub struct Panels {
    size: usize,
    values: Vec<f32>,
}

impl Panels {
    /// Returns the panels of a square matrix, given row by row.
    pub fn new(matrix: &[f64], size: usize) -> Self {
        let panels = size.div_ceil(PANEL);
        let mut values = vec![0.0; panels * PANEL * size];
        for panel in 0..panels {
            for column in 0..size {
                for lane in 0..PANEL.min(size - panel * PANEL) {
                    let row = panel * PANEL + lane;
                    values[(panel * size + column) * PANEL + lane] = matrix[row * size + column] as f32;
                }
            }
        }
        Self { size, values }
    }

    /// Writes the matrix times each of `vectors` to `out`. Vectors follow one another, and so do results, each with its
    /// padding: see [`Panels::padded`].
    pub fn multiply(&self, vectors: &[f32], out: &mut [f32]) {
        let (size, padded) = (self.size, Self::padded(self.size));
        // The matrix is too large for the nearest cache; sums of more than three vectors are too many for the registers.
        for (vectors, out) in vectors.chunks(3 * size).zip(out.chunks_mut(3 * padded)) {
            match vectors.len() / size {
                3 => dispatch(Product::<3> { panels: self, vectors, out }),
                2 => dispatch(Product::<2> { panels: self, vectors, out }),
                _ => dispatch(Product::<1> { panels: self, vectors, out }),
            }
        }
    }

    /// Returns the length of a result with its padding.
    pub fn padded(size: usize) -> usize {
        size.div_ceil(PANEL) * PANEL
    }
}

/// A product with `K` vectors. Where registers allow, a row has more than one sum, which hides latency.
struct Product<'a, const K: usize> {
    panels: &'a Panels,
    vectors: &'a [f32],
    out: &'a mut [f32],
}

impl<const K: usize> Kernel for Product<'_, K> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let size = self.panels.size;
        let registers = PANEL / S::F32_LANES;
        let padded = Panels::padded(size) / S::F32_LANES;
        let out = S::as_mut_simd_f32s(self.out).0;
        let second = if K == 1 { 1 } else { 0 };
        for (p, panel) in self.panels.values.chunks_exact(PANEL * size).enumerate() {
            // As many sums as the narrowest vectors need: of one lane.
            let mut sums = [[[simd.splat_f32s(0.0); PANEL]; K]; 2];
            let mut pairs = S::as_simd_f32s(panel).0.chunks_exact(2 * registers);
            for (c, pair) in pairs.by_ref().enumerate() {
                for k in 0..K {
                    let x = &self.vectors[k * size + 2 * c..][..2];
                    let (x0, x1) = (simd.splat_f32s(x[0]), simd.splat_f32s(x[1]));
                    for v in 0..registers {
                        sums[0][k][v] = simd.fused_f32s(pair[v], x0, sums[0][k][v]);
                        sums[second][k][v] = simd.fused_f32s(pair[registers + v], x1, sums[second][k][v]);
                    }
                }
            }
            let last = pairs.remainder();
            if !last.is_empty() {
                for k in 0..K {
                    let x = simd.splat_f32s(self.vectors[k * size + size - 1]);
                    for v in 0..registers {
                        sums[0][k][v] = simd.fused_f32s(last[v], x, sums[0][k][v]);
                    }
                }
            }
            for k in 0..K {
                for v in 0..registers {
                    out[k * padded + p * registers + v] = simd.add_f32s(sums[0][k][v], sums[1][k][v]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::invert;

    #[test]
    fn inverse_times_matrix_is_one() {
        for size in [1usize, 7, 50, 99] {
            let entry = |r: usize, c: usize| {
                ((r * 37 + c * 101) % 53) as f64 / 53.0 + if (r + 3) % size == c { 5.0 } else { 0.0 }
            };
            let matrix: Vec<f64> = (0..size * size).map(|q| entry(q / size, q % size)).collect();
            let mut inverse = matrix.clone();
            assert!(invert(&mut inverse, size));
            let panels = Panels::new(&inverse, size);
            // Column by column and all at once.
            let columns: Vec<f32> = (0..size * size).map(|q| matrix[(q % size) * size + q / size] as f32).collect();
            let padded = Panels::padded(size);
            let mut all = vec![0.0; size * padded];
            panels.multiply(&columns, &mut all);
            for c in 0..size {
                let mut out = vec![0.0; padded];
                panels.multiply(&columns[c * size..(c + 1) * size], &mut out);
                for (r, (v, w)) in out.iter().zip(&all[c * padded..]).take(size).enumerate() {
                    let want = if r == c { 1.0 } else { 0.0 };
                    assert!((v - want).abs() < 1e-4 && (w - want).abs() < 1e-4, "{size} {r} {c} {v} {w}");
                }
            }
        }
    }
}
