//! Bending energy 1/2 EI/l_i |kappa_i - kappa0_i|^2 at every inner node, and its derivatives.
//!
//! l_i is the Voronoi length, kappa_i the two material curvatures of [`Frames::curvature`]. The second derivatives
//! follow Bergou et al. 2010 (appendix), with the symmetric treatment of the directors' parallel transport.

use super::stencil::{ByNode, add_local, spread_edges, symmetric};
use super::{Rod, band::Band, frames::Frames};
use crate::V3;
use crate::lanes::{Vectors, Wide};
use crate::simd::Simd;
use nalgebra::Matrix3;

/// Returns the energy in J.
pub fn energy(rod: &Rod, frames: &Frames) -> f64 {
    (1..rod.nodes() - 1)
        .map(|i| {
            let [b1, b2] = excess(rod, frames, i);
            0.5 * rod.stiffness.bend_nm2 / rod.voronoi_length[i] * (b1 * b1 + b2 * b2)
        })
        .sum()
}

#[inline(always)]
fn excess(rod: &Rod, frames: &Frames, i: usize) -> [f64; 2] {
    let ([k1, k2], [n1, n2]) = (frames.curvature(i), rod.natural_curvature[i]);
    [k1 - n1, k2 - n2]
}

/// Adds the derivatives of neighbouring nodes from `i` on with the natural curvatures `natural` and the
/// moduli EI/l_i `modulus`.
#[inline(always)]
pub(super) fn add_gradient<S: Simd>(
    simd: S,
    frames: &Frames,
    i: usize,
    natural: [Wide<S>; 2],
    modulus: Wide<S>,
    out: &mut ByNode<S>,
) {
    let load = |vectors: &Vectors, at: usize| vectors.load(simd, at);
    let (te, tf) = (load(&frames.tangent, i - 1), load(&frames.tangent, i));
    let (m1e, m1f) = (load(&frames.m1, i - 1), load(&frames.m1, i));
    let (m2e, m2f) = (load(&frames.m2, i - 1), load(&frames.m2, i));
    let (kb, inverse_chi) = (load(&frames.binormal, i), Wide::load(simd, &frames.inverse_chi, i));
    let (s1, s2) = (m1e + m1f, m2e + m2f);
    let (k1, k2) = (kb.dot(s2).scaled(0.5), kb.dot(s1).scaled(-0.5));
    let (b1, b2) = (modulus * (k1 - natural[0]), modulus * (k2 - natural[1]));
    // b1 grad kappa1 + b2 grad kappa2, summed before the cross products.
    let mean = (te + tf) * inverse_chi;
    let couple = (s2 * b1 - s1 * b2) * inverse_chi;
    let along = mean * (b1 * k1 + b2 * k2);
    out.edges[0] = out.edges[0] + (tf.cross(couple) - along);
    out.edges[1] = out.edges[1] - (te.cross(couple) + along);
    out.angles[0] = out.angles[0] - kb.dot(m1e * b1 + m2e * b2).scaled(0.5);
    out.angles[1] = out.angles[1] - kb.dot(m1f * b1 + m2f * b2).scaled(0.5);
}

/// Adds the Hessian.
pub fn add_hessian(rod: &Rod, frames: &Frames, out: &mut Band) {
    for i in 1..rod.nodes() - 1 {
        let local = node_hessian(rod, frames, i);
        add_local(out, i, &local);
    }
}

fn spread_gradient(by_e: V3, by_f: V3, by_angles: [f64; 2]) -> [f64; 11] {
    let mut g = [0.0; 11];
    for a in 0..3 {
        g[a] = -by_e[a];
        g[4 + a] = by_e[a] - by_f[a];
        g[8 + a] = by_f[a];
    }
    g[3] = by_angles[0];
    g[7] = by_angles[1];
    g
}

fn node_hessian(rod: &Rod, frames: &Frames, i: usize) -> [[f64; 11]; 11] {
    let (te, tf) = (frames.tangent.at(i - 1), frames.tangent.at(i));
    let (le, lf) = (frames.length[i - 1], frames.length[i]);
    let (m1e, m1f, m2e, m2f) = (frames.m1.at(i - 1), frames.m1.at(i), frames.m2.at(i - 1), frames.m2.at(i));
    let (kb, ic) = (frames.binormal.at(i), frames.inverse_chi[i]);
    let mean = (te + tf) * ic;
    let (d1, d2) = ((m1e + m1f) * ic, (m2e + m2f) * ic);
    let [k1, k2] = frames.curvature(i);
    let modulus = rod.stiffness.bend_nm2 / rod.voronoi_length[i];
    let b1 = modulus * (k1 - rod.natural_curvature[i][0]);
    let b2 = modulus * (k2 - rod.natural_curvature[i][1]);
    let (a1, a2, c1, c2) = (tf.cross(&d1), tf.cross(&d2), te.cross(&d1), te.cross(&d2));

    let g1 = spread_gradient((a2 - mean * k1) / le, -(c2 + mean * k1) / lf, [-0.5 * kb.dot(&m1e), -0.5 * kb.dot(&m1f)]);
    let g2 = spread_gradient(-(a1 + mean * k2) / le, (c1 - mean * k2) / lf, [-0.5 * kb.dot(&m2e), -0.5 * kb.dot(&m2f)]);

    let identity = Matrix3::identity();
    let (across_e, across_f) = (identity - te * te.transpose(), identity - tf * tf.transpose());
    let cross_ef = identity + te * tf.transpose();
    let mm = mean * mean.transpose();
    let (le2, lf2, lef) = (le * le, lf * lf, le * lf);
    let ee = (mm * (2.0 * k1) - symmetric(a2, mean) - across_e * (k1 * ic) + symmetric(kb, m2e) * 0.25) * (b1 / le2)
        + (mm * (2.0 * k2) + symmetric(a1, mean) - across_e * (k2 * ic) - symmetric(kb, m1e) * 0.25) * (b2 / le2);
    let ff = (mm * (2.0 * k1) + symmetric(c2, mean) - across_f * (k1 * ic) + symmetric(kb, m2f) * 0.25) * (b1 / lf2)
        + (mm * (2.0 * k2) - symmetric(c1, mean) - across_f * (k2 * ic) - symmetric(kb, m1f) * 0.25) * (b2 / lf2);
    let ef = (mm * (2.0 * k1) - a2 * mean.transpose() + mean * c2.transpose()
        - d2.cross_matrix()
        - cross_ef * (k1 * ic))
        * (b1 / lef)
        + (mm * (2.0 * k2) + a1 * mean.transpose() - mean * c1.transpose() + d1.cross_matrix() - cross_ef * (k2 * ic))
            * (b2 / lef);

    let mut local = [[0.0; 11]; 11];
    spread_edges(&mut local, ee, ff, ef);
    local[3][3] += 0.5 * (b2 * kb.dot(&m1e) - b1 * kb.dot(&m2e));
    local[7][7] += 0.5 * (b2 * kb.dot(&m1f) - b1 * kb.dot(&m2f));
    for (slot, m1, m2) in [(3, m1e, m2e), (7, m1f, m2f)] {
        let turned = m1 * b1 + m2 * b2;
        let half = 0.5 * kb.dot(&turned);
        let by_e = (mean * half - tf.cross(&turned) * ic) / le;
        let by_f = (mean * half + te.cross(&turned) * ic) / lf;
        for a in 0..3 {
            for (row, value) in [(a, -by_e[a]), (4 + a, by_e[a] - by_f[a]), (8 + a, by_f[a])] {
                local[row][slot] += value;
                local[slot][row] += value;
            }
        }
    }
    for a in 0..11 {
        for b in 0..11 {
            local[a][b] += modulus * (g1[a] * g1[b] + g2[a] * g2[b]);
        }
    }
    local
}
