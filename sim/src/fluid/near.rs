//! The part of a rod's own mobility that Gauss points cannot give: near segments, exactly.
//!
//! For every node and the segments within a few edges of it: the exact segment less its Gauss rule,
//! so that the sum with the point Stokeslets of *all* segments is exact near and Gauss far. Stored by
//! diagonals, vectorised over the nodes; formulas as in [`super::segment`], with T_{0,-1} =
//! (2/L) atanh(L/(R0 + R1)) from two half-angle steps and an odd series instead of a logarithm.

use super::{far::gauss_rule, stokeslet_factor};
use crate::V3;
use pulp::{Simd, WithSimd};

const LANES: usize = 8;

/// Shortest regularisation, in segment lengths, for which the series is good to 1e-11.
pub const LEAST_EPSILON: f64 = 0.15;

/// Half-angle steps leave an argument below 0.31; eleven terms are then good to 1e-12.
#[inline(always)]
fn atanh_small(q: f64) -> f64 {
    let z = q * q;
    let mut sum = 1.0 / 21.0;
    let mut odd = 19.0;
    while odd >= 1.0 {
        sum = sum * z + 1.0 / odd;
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
    /// One of each diagonal: the six components xx, xy, xz, yy, yz, zz, padded to whole vectors.
    diagonals: Vec<[Vec<f64>; 6]>,
    /// Padded nodes, `reach` before and after the rod.
    padded: [Vec<f64>; 3],
    /// 1 for segments that exist.
    mask: Vec<f64>,
    density: [Vec<f64>; 3],
    flow: [Vec<f64>; 3],
}

impl NearBand {
    /// For a rod of `nodes` nodes, exact within `reach` edges, with `gauss_points` a segment to take off.
    pub fn new(nodes: usize, reach: usize, gauss_points: usize) -> Self {
        let rows = nodes.div_ceil(LANES) * LANES;
        let length = rows + 2 * reach + 2;
        let mut mask = vec![0.0; length];
        mask[reach..reach + nodes - 1].fill(1.0);
        let zeros = |n: usize| std::array::from_fn(|_| vec![0.0; n]);
        Self {
            nodes,
            reach,
            rule: gauss_rule(gauss_points),
            diagonals: (0..=2 * reach).map(|_| std::array::from_fn(|_| vec![0.0; rows])).collect(),
            padded: zeros(length),
            mask,
            density: zeros(length),
            flow: zeros(rows),
        }
    }

    /// Recomputes the band at a shape (length `nodes`), 1/(8 pi mu) included.
    pub fn assemble(&mut self, shape: &[V3], epsilon: f64, viscosity: f64) {
        let (n, reach) = (self.nodes, self.reach);
        // Beyond the ends the line goes on straight: the numbers stay tame, the mask drops them.
        let (before, after) = (shape[0] - shape[1], shape[n - 1] - shape[n - 2]);
        for q in 0..self.padded[0].len() {
            let node = if q < reach {
                shape[0] + before * (reach - q) as f64
            } else if q - reach < n {
                shape[q - reach]
            } else {
                shape[n - 1] + after * (q - reach - n + 1) as f64
            };
            for axis in 0..3 {
                self.padded[axis][q] = node[axis];
            }
        }
        let (e2, factor) = (epsilon * epsilon, stokeslet_factor(viscosity));
        pulp::Arch::new().dispatch(Assemble { band: self, e2, factor });
    }

    #[inline(always)]
    fn assemble_diagonals(&mut self, e2: f64, factor: f64) {
        for diagonal in &mut self.diagonals {
            for component in diagonal.iter_mut() {
                component.fill(0.0);
            }
        }
        let rows = self.flow[0].len();
        for offset in 0..2 * self.reach {
            for block in (0..rows).step_by(LANES) {
                let mut out = [[0.0; LANES]; 12];
                let at = block + self.reach;
                let start = block + offset;
                let [px, py, pz] = &self.padded;
                let mask = &self.mask[start..start + LANES];
                // Plain loops and indices: closures would be compiled without the vector instructions.
                for k in 0..LANES {
                    let y = [px[start + k], py[start + k], pz[start + k]];
                    let v = [y[0] - px[start + 1 + k], y[1] - py[start + 1 + k], y[2] - pz[start + 1 + k]];
                    let d = [px[at + k] - y[0], py[at + k] - y[1], pz[at + k] - y[2]];
                    let moments = difference_moments(d, v, e2, self.rule);
                    let values = components(d, v, e2, moments);
                    let scale = factor * mask[k] * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
                    for q in 0..12 {
                        out[q][k] = scale * values[q];
                    }
                }
                let (low, high) = self.diagonals.split_at_mut(offset + 1);
                for q in 0..6 {
                    for k in 0..LANES {
                        low[offset][q][block + k] += out[q][k];
                        high[0][q][block + k] = out[6 + q][k];
                    }
                }
            }
        }
    }

    /// Velocity at each node from the band alone; [`NearBand::flow`] reads it.
    pub fn multiply(&mut self, density: &[V3]) {
        for (i, f) in density.iter().enumerate() {
            for axis in 0..3 {
                self.density[axis][self.reach + i] = f[axis];
            }
        }
        pulp::Arch::new().dispatch(Multiply(self));
    }

    #[inline(always)]
    fn multiply_padded(&mut self) {
        let [fx, fy, fz] = &self.density;
        let rows = self.flow[0].len();
        for block in (0..rows).step_by(LANES) {
            let mut sums = [[0.0; LANES]; 3];
            for (offset, diagonal) in self.diagonals.iter().enumerate() {
                let [xx, xy, xz, yy, yz, zz] = diagonal;
                let a = [
                    &xx[block..block + LANES],
                    &xy[block..block + LANES],
                    &xz[block..block + LANES],
                    &yy[block..block + LANES],
                    &yz[block..block + LANES],
                    &zz[block..block + LANES],
                ];
                let at = block + offset;
                let (gx, gy, gz) = (&fx[at..at + LANES], &fy[at..at + LANES], &fz[at..at + LANES]);
                for k in 0..LANES {
                    sums[0][k] += a[0][k] * gx[k] + a[1][k] * gy[k] + a[2][k] * gz[k];
                    sums[1][k] += a[1][k] * gx[k] + a[3][k] * gy[k] + a[4][k] * gz[k];
                    sums[2][k] += a[2][k] * gx[k] + a[4][k] * gy[k] + a[5][k] * gz[k];
                }
            }
            for axis in 0..3 {
                self.flow[axis][block..block + LANES].copy_from_slice(&sums[axis]);
            }
        }
    }

    /// Velocity of a node after [`NearBand::multiply`], m/s.
    #[inline(always)]
    pub fn flow(&self, i: usize) -> V3 {
        V3::new(self.flow[0][i], self.flow[1][i], self.flow[2][i])
    }
}

/// Compiles the assembly for the machine's vector instructions.
struct Assemble<'a> {
    band: &'a mut NearBand,
    e2: f64,
    factor: f64,
}

impl WithSimd for Assemble<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.band.assemble_diagonals(self.e2, self.factor);
    }
}

/// Compiles the product for the machine's vector instructions.
struct Multiply<'a>(&'a mut NearBand);

impl WithSimd for Multiply<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.0.multiply_padded();
    }
}

/// Moments T_{0,-1}, T_{1,-1}, T_{0..3,-3}: exact less the Gauss rule.
#[inline(always)]
fn difference_moments(d: [f64; 3], v: [f64; 3], e2: f64, rule: &[(f64, f64)]) -> [f64; 6] {
    let l2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
    let s0 = d[0] * v[0] + d[1] * v[1] + d[2] * v[2];
    let r0s = d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + e2;
    let s1 = s0 + l2;
    let (r0, r1) = (r0s.sqrt(), (r0s + 2.0 * s0 + l2).sqrt());
    let (i0, i1) = (1.0 / r0, 1.0 / r1);
    let il2 = 1.0 / l2;
    let l = l2.sqrt();
    let sum = r0 + r1;
    let half = l / (sum + (sum * sum - l2).sqrt());
    let quarter = half / (1.0 + (1.0 - half * half).sqrt());
    let t01 = 8.0 * il2 * l * atanh_small(quarter);
    let t03 = (s1 * i1 - s0 * i0) / (l2 * r0s - s0 * s0);
    let t11 = (r1 - r0 - s0 * t01) * il2;
    let t13 = -(i1 - i0 + s0 * t03) * il2;
    let t23 = (-i1 + t01 - s0 * t13) * il2;
    let t33 = (-i1 + 2.0 * t11 - s0 * t23) * il2;
    let mut t = [t01, t11, t03, t13, t23, t33];
    for (a, weight) in rule {
        let inverse = 1.0 / (r0s + a * (2.0 * s0 + a * l2)).sqrt();
        let w1 = weight * inverse;
        let w3 = w1 * inverse * inverse;
        t[0] -= w1;
        t[1] -= w1 * a;
        t[2] -= w3;
        t[3] -= w3 * a;
        t[4] -= w3 * a * a;
        t[5] -= w3 * a * a * a;
    }
    t
}

const PAIRS: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// Components xx, xy, xz, yy, yz, zz of A1 and then of A2.
#[inline(always)]
fn components(d: [f64; 3], v: [f64; 3], e2: f64, t: [f64; 6]) -> [f64; 12] {
    let [t01, t11, t03, t13, t23, t33] = t;
    let direct2 = t11 + e2 * t13;
    let direct1 = t01 + e2 * t03 - direct2;
    let (a1, b1, c1) = (t03 - t13, t13 - t23, t23 - t33);
    let mut out = [0.0; 12];
    for q in 0..6 {
        let (a, b) = PAIRS[q];
        let (xx, xv, vv) = (d[a] * d[b], d[a] * v[b] + d[b] * v[a], v[a] * v[b]);
        let identity = if a == b { 1.0 } else { 0.0 };
        out[q] = identity * direct1 + a1 * xx + b1 * xv + c1 * vv;
        out[6 + q] = identity * direct2 + t13 * xx + t23 * xv + t33 * vv;
    }
    out
}
