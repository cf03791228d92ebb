//! Twist energy 1/2 GJ/l_i (tau_i - tau0_i)^2 at every inner node, and its derivatives.
//!
//! tau_i = theta_i - theta_{i-1} + reference twist; the reference twist varies with the edges as
//! kb/(2 |e|) (Bergou et al. 2008, section 6; second derivatives Bergou et al. 2010).

use super::stencil::{ByNode, add_local, spread_edges, symmetric};
use super::{Rod, band::Band, frames::Frames};
use crate::lanes::Wide;
use crate::simd::Simd;

/// Returns the energy in J.
pub fn energy(rod: &Rod, frames: &Frames, angles: &[f64]) -> f64 {
    (1..rod.nodes() - 1)
        .map(|i| {
            let excess = frames.twist(i, angles) - rod.natural_twist[i];
            0.5 * rod.stiffness.twist_nm2 / rod.voronoi_length[i] * excess * excess
        })
        .sum()
}

/// Adds the derivatives of neighbouring nodes from `i` on; `twist` and `natural` in rad, `modulus` GJ/l_i.
#[inline(always)]
pub(super) fn add_gradient<S: Simd>(
    simd: S,
    frames: &Frames,
    i: usize,
    [twist, natural]: [Wide<S>; 2],
    modulus: Wide<S>,
    out: &mut ByNode<S>,
) {
    let torque = modulus * (twist - natural);
    let half = frames.binormal.load(simd, i) * torque.scaled(0.5);
    out.edges = out.edges.map(|by_edge| by_edge + half);
    out.angles = [out.angles[0] - torque, out.angles[1] + torque];
}

/// Adds the Hessian.
pub fn add_hessian(rod: &Rod, frames: &Frames, angles: &[f64], out: &mut Band) {
    for i in 1..rod.nodes() - 1 {
        let (te, tf) = (frames.tangent.at(i - 1), frames.tangent.at(i));
        let (le, lf) = (frames.length[i - 1], frames.length[i]);
        let (kb, ic) = (frames.binormal.at(i), frames.inverse_chi[i]);
        let mean = (te + tf) * ic;
        let modulus = rod.stiffness.twist_nm2 / rod.voronoi_length[i];
        let torque = modulus * (frames.twist(i, angles) - rod.natural_twist[i]);

        let mut gradient = [0.0; 11];
        for a in 0..3 {
            gradient[a] = -0.5 / le * kb[a];
            gradient[8 + a] = 0.5 / lf * kb[a];
            gradient[4 + a] = -(gradient[a] + gradient[8 + a]);
        }
        gradient[3] = -1.0;
        gradient[7] = 1.0;

        let mut local = [[0.0; 11]; 11];
        spread_edges(
            &mut local,
            symmetric(kb, te + mean) * (-0.25 * torque / (le * le)),
            symmetric(kb, tf + mean) * (-0.25 * torque / (lf * lf)),
            (te.cross_matrix() * (2.0 * ic) - kb * mean.transpose()) * (0.5 * torque / (le * lf)),
        );
        for a in 0..11 {
            for b in 0..11 {
                local[a][b] += modulus * gradient[a] * gradient[b];
            }
        }
        add_local(out, i, &local);
    }
}
