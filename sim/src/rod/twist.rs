//! Twist energy 1/2 GJ/l_i (tau_i - tau0_i)^2 at every inner node, and its derivatives.
//!
//! tau_i = theta_i - theta_{i-1} + reference twist; the reference twist varies with the edges as
//! kb/(2 |e|) (Bergou et al. 2008, section 6; second derivatives Bergou et al. 2010).

use super::bend::{add_local, spread_edges, symmetric};
use super::{Rod, add_at, band::Band, frames::Frames};

/// Energy in J.
pub fn energy(rod: &Rod, frames: &Frames, angles: &[f64]) -> f64 {
    (1..rod.nodes() - 1)
        .map(|i| {
            let excess = frames.twist(i, angles) - rod.natural_twist[i];
            0.5 * rod.stiffness.twist_nm2 / rod.voronoi_length[i] * excess * excess
        })
        .sum()
}

/// Adds the gradient.
pub fn add_gradient(rod: &Rod, frames: &Frames, angles: &[f64], out: &mut [f64]) {
    for i in 1..rod.nodes() - 1 {
        let torque = rod.stiffness.twist_nm2 / rod.voronoi_length[i] * (frames.twist(i, angles) - rod.natural_twist[i]);
        let half = frames.binormal[i] * (0.5 * torque);
        let (by_e, by_f) = (half / frames.length[i - 1], half / frames.length[i]);
        add_at(out, i - 1, -by_e);
        add_at(out, i, by_e - by_f);
        add_at(out, i + 1, by_f);
        out[4 * (i - 1) + 3] -= torque;
        out[4 * i + 3] += torque;
    }
}

/// Adds the Hessian.
pub fn add_hessian(rod: &Rod, frames: &Frames, angles: &[f64], out: &mut Band) {
    for i in 1..rod.nodes() - 1 {
        let (te, tf) = (frames.tangent[i - 1], frames.tangent[i]);
        let (le, lf) = (frames.length[i - 1], frames.length[i]);
        let (kb, ic) = (frames.binormal[i], frames.inverse_chi[i]);
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
