//! The degrees of freedom that bending and twist at a node depend on: two edges, three nodes and two angles.
//!
//! With four slots a node, this is a block of 11: x_{i-1}, theta_{i-1}, x_i, theta_i, x_{i+1}.

use super::band::Band;
use crate::V3;
use crate::lanes::{Wide, Wide3};
use crate::simd::Simd;
use nalgebra::Matrix3;

/// Derivatives of the energy at neighbouring nodes.
pub(super) struct ByNode<S: Simd> {
    /// With respect to the unit tangents of the edges before and after a node, N m. Divided by the edge's length, they
    /// are derivatives with respect to the edge.
    pub edges: [Wide3<S>; 2],
    /// With respect to the angles of these edges, N m.
    pub angles: [Wide<S>; 2],
}

/// Adds an 11 x 11 block of node `i` (slots of x_{i-1}, theta_{i-1}, x_i, theta_i, x_{i+1}).
pub(super) fn add_local(out: &mut Band, i: usize, local: &[[f64; 11]; 11]) {
    let origin = 4 * (i - 1);
    for (a, row) in local.iter().enumerate() {
        for (b, value) in row.iter().enumerate() {
            out.add(origin + a, origin + b, *value);
        }
    }
}

/// Spreads derivatives with respect to the edges e (before) and f (after) over the three nodes.
pub(super) fn spread_edges(local: &mut [[f64; 11]; 11], ee: Matrix3<f64>, ff: Matrix3<f64>, ef: Matrix3<f64>) {
    let fe = ef.transpose();
    for a in 0..3 {
        for b in 0..3 {
            let at = (a, b);
            local[a][b] += ee[at];
            local[a][4 + b] += ef[at] - ee[at];
            local[a][8 + b] -= ef[at];
            local[4 + a][b] += fe[at] - ee[at];
            local[4 + a][4 + b] += ee[at] - ef[at] - fe[at] + ff[at];
            local[4 + a][8 + b] += ef[at] - ff[at];
            local[8 + a][b] -= fe[at];
            local[8 + a][4 + b] += fe[at] - ff[at];
            local[8 + a][8 + b] += ff[at];
        }
    }
}

/// Returns a b' + b a'.
pub(super) fn symmetric(a: V3, b: V3) -> Matrix3<f64> {
    a * b.transpose() + b * a.transpose()
}
