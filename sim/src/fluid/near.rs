//! The near part of a rod's own mobility, where Gauss points are too coarse: exact segments.
//!
//! The band holds, for every node and the segments within a few edges of it, the exact segment less its Gauss rule.
//! Added to the point Stokeslets of *all* segments, it makes near segments exact and leaves the Gauss rule for far
//! ones. Stored by diagonals, vectorised over the nodes; formulas as in [`super::segment`], with T_{0,-1} = (2/L)
//! atanh(L/(R0 + R1)) from two half-angle steps and an odd series instead of a logarithm.

use super::{far::gauss_rule, stokeslet_factor};
use crate::V3;
use crate::lanes::{PADDING, Vectors, Wide, Wide3};
use crate::simd::{Kernel, Simd, dispatch};

/// Returns the inverse hyperbolic tangent. Half-angle steps leave an argument below 0.31; eleven terms are then good to
/// 1e-12.
#[inline(always)]
fn atanh_small<S: Simd>(simd: S, q: Wide<S>) -> Wide<S> {
    let z = q * q;
    let mut sum = Wide::all(simd, 1.0 / 21.0);
    let mut odd = 19.0;
    while odd >= 1.0 {
        sum = sum.times_plus(z, Wide::all(simd, 1.0 / odd));
        odd -= 2.0;
    }
    q * sum
}

/// Banded correction of one rod's own mobility.
#[derive(Clone, Debug)]
pub struct NearBand {
    nodes: usize,
    reach: usize,
    rule: &'static [(f64, f64)],
    /// For each diagonal the six components xx, xy, xz, yy, yz, zz, padded to whole vectors.
    diagonals: Vec<[Vec<f64>; 6]>,
    /// Padded nodes, `reach` before and after the rod.
    padded: Vectors,
    /// 1 for segments that exist.
    mask: Vec<f64>,
    density: Vectors,
    flow: Vectors,
}

impl NearBand {
    /// Returns the band of a rod of `nodes` nodes, exact within `reach` edges, from which a Gauss rule of
    /// `gauss_points` points per segment is subtracted.
    pub fn new(nodes: usize, reach: usize, gauss_points: usize) -> Self {
        let rows = nodes.div_ceil(PADDING) * PADDING;
        let length = rows + 2 * reach + 2;
        let mut mask = vec![0.0; length];
        mask[reach..reach + nodes - 1].fill(1.0);
        Self {
            nodes,
            reach,
            rule: gauss_rule(gauss_points),
            diagonals: (0..=2 * reach).map(|_| std::array::from_fn(|_| vec![0.0; rows])).collect(),
            padded: Vectors::new(length),
            mask,
            density: Vectors::new(length),
            flow: Vectors::new(rows),
        }
    }

    /// Recomputes the band at a shape (length `nodes`), including the factor 1/(8 pi mu).
    pub fn assemble(&mut self, shape: &[V3], epsilon: f64, viscosity: f64) {
        let (n, reach) = (self.nodes, self.reach);
        // Beyond the ends the line is straight: its numbers stay finite, and the mask drops them.
        let (before, after) = (shape[0] - shape[1], shape[n - 1] - shape[n - 2]);
        for q in 0..self.mask.len() {
            let node = if q < reach {
                shape[0] + before * (reach - q) as f64
            } else if q - reach < n {
                shape[q - reach]
            } else {
                shape[n - 1] + after * (q - reach - n + 1) as f64
            };
            self.padded.set(q, node);
        }
        let (e2, factor) = (epsilon * epsilon, stokeslet_factor(viscosity));
        dispatch(Assemble { band: self, e2, factor });
    }

    fn rows(&self) -> usize {
        self.diagonals[0][0].len()
    }

    #[inline(always)]
    fn assemble_diagonals<S: Simd>(&mut self, simd: S, e2: f64, factor: f64) {
        for diagonal in &mut self.diagonals {
            for component in diagonal.iter_mut() {
                component.fill(0.0);
            }
        }
        let rows = self.rows();
        let factor = Wide::all(simd, factor);
        for offset in 0..2 * self.reach {
            for block in (0..rows).step_by(S::F64_LANES) {
                let (at, start) = (block + self.reach, block + offset);
                let x = self.padded.load(simd, at).0;
                let y0 = self.padded.load(simd, start).0;
                let y1 = self.padded.load(simd, start + 1).0;
                let v = [y0[0] - y1[0], y0[1] - y1[1], y0[2] - y1[2]];
                let d = [x[0] - y0[0], x[1] - y0[1], x[2] - y0[2]];
                let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
                let scale = Wide::load(simd, &self.mask, start) * length * factor;
                let moments = difference_moments(simd, d, v, e2, self.rule);
                let values = components(simd, d, v, e2, moments);
                let (low, high) = self.diagonals.split_at_mut(offset + 1);
                for q in 0..6 {
                    let first = &mut low[offset][q];
                    (Wide::load(simd, first, block) + values[q] * scale).store(first, block);
                    (values[6 + q] * scale).store(&mut high[0][q], block);
                }
            }
        }
    }

    /// Computes the velocity at each node from the band alone; [`NearBand::flow`] returns it. `density`: N/m.
    pub fn multiply(&mut self, density: &[V3]) {
        for (i, f) in density.iter().enumerate() {
            self.density.set(self.reach + i, *f);
        }
        dispatch(Multiply(self));
    }

    #[inline(always)]
    fn multiply_padded<S: Simd>(&mut self, simd: S) {
        let rows = self.rows();
        for block in (0..rows).step_by(S::F64_LANES) {
            let zero = Wide::all(simd, 0.0);
            let mut sums = [zero; 3];
            for (offset, diagonal) in self.diagonals.iter().enumerate() {
                let g = self.density.load(simd, block + offset).0;
                for q in 0..6 {
                    let (a, b) = PAIRS[q];
                    let entry = Wide::load(simd, &diagonal[q], block);
                    sums[a] = entry.times_plus(g[b], sums[a]);
                    if a != b {
                        sums[b] = entry.times_plus(g[a], sums[b]);
                    }
                }
            }
            self.flow.store(Wide3(sums), block);
        }
    }

    /// Returns the velocity of a node after [`NearBand::multiply`], m/s.
    #[inline(always)]
    pub fn flow(&self, i: usize) -> V3 {
        self.flow.at(i)
    }
}

/// Compiles the assembly for the machine's vector instructions.
struct Assemble<'a> {
    band: &'a mut NearBand,
    e2: f64,
    factor: f64,
}

impl Kernel for Assemble<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        self.band.assemble_diagonals(simd, self.e2, self.factor);
    }
}

/// Compiles the product for the machine's vector instructions.
struct Multiply<'a>(&'a mut NearBand);

impl Kernel for Multiply<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        self.0.multiply_padded(simd);
    }
}

/// Moments T_{0,-1}, T_{1,-1}, T_{0..3,-3}: exact less the Gauss rule.
#[inline(always)]
fn difference_moments<S: Simd>(
    simd: S,
    d: [Wide<S>; 3],
    v: [Wide<S>; 3],
    e2: f64,
    rule: &[(f64, f64)],
) -> [Wide<S>; 6] {
    let two = Wide::all(simd, 2.0);
    let l2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
    let s0 = d[0] * v[0] + d[1] * v[1] + d[2] * v[2];
    let r0s = d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + Wide::all(simd, e2);
    let s1 = s0 + l2;
    let (r0, r1) = (r0s.sqrt(), (r0s + two * s0 + l2).sqrt());
    let i01 = (r0 * r1).inverse();
    let (i0, i1) = (i01 * r1, i01 * r0);
    let il2 = l2.inverse();
    let l = l2.sqrt();
    let sum = r0 + r1;
    let half = l * (sum + (sum * sum - l2).sqrt()).inverse();
    let one = Wide::all(simd, 1.0);
    let quarter = half * (one + (one - half * half).sqrt()).inverse();
    let t01 = Wide::all(simd, 8.0) * il2 * l * atanh_small(simd, quarter);
    let t03 = (s1 * i1 - s0 * i0) * (l2 * r0s - s0 * s0).inverse();
    let t11 = (r1 - r0 - s0 * t01) * il2;
    let t13 = -(i1 - i0 + s0 * t03) * il2;
    let t23 = (t01 - i1 - s0 * t13) * il2;
    let t33 = (two * t11 - i1 - s0 * t23) * il2;
    let mut t = [t01, t11, t03, t13, t23, t33];
    for (point, weight) in rule {
        let a = Wide::all(simd, *point);
        let inverse = (r0s + a * (two * s0 + a * l2)).sqrt().inverse();
        let mut w1 = Wide::all(simd, *weight) * inverse;
        let mut w3 = w1 * inverse * inverse;
        for m in 0..4 {
            if m < 2 {
                t[m] = t[m] - w1;
                w1 = w1 * a;
            }
            t[2 + m] = t[2 + m] - w3;
            w3 = w3 * a;
        }
    }
    t
}

const PAIRS: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// Components xx, xy, xz, yy, yz, zz of A1 and then of A2.
#[inline(always)]
fn components<S: Simd>(simd: S, d: [Wide<S>; 3], v: [Wide<S>; 3], e2: f64, t: [Wide<S>; 6]) -> [Wide<S>; 12] {
    let [t01, t11, t03, t13, t23, t33] = t;
    let e2 = Wide::all(simd, e2);
    let direct2 = t11 + e2 * t13;
    let direct1 = t01 + e2 * t03 - direct2;
    let (a1, b1, c1) = (t03 - t13, t13 - t23, t23 - t33);
    let mut out = [Wide::all(simd, 0.0); 12];
    for q in 0..6 {
        let (a, b) = PAIRS[q];
        let (xx, xv, vv) = (d[a] * d[b], d[a] * v[b] + d[b] * v[a], v[a] * v[b]);
        out[q] = a1 * xx + b1 * xv + c1 * vv;
        out[6 + q] = t13 * xx + t23 * xv + t33 * vv;
        if a == b {
            out[q] = out[q] + direct1;
            out[6 + q] = out[6 + q] + direct2;
        }
    }
    out
}
