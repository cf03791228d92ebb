//! The dense mobility matrix of regularised Stokeslet segments, and the drag of rigid motions.
//!
//! The matrix is not symmetric (a density is linear, a velocity is collocated at nodes), so systems
//! with it need a factorisation for general matrices; a Cholesky factorisation of it gives nodal
//! forces that are wrong by tens of per cent.

use super::{segment::segment_flow, stokeslet_factor};
use crate::V3;
use nalgebra::{DMatrix, DVector, Matrix6};

/// Returns the mobility matrix of several centre lines (m) on all their nodes, stacked in order.
///
/// Row `3 i + a` is component a of the velocity (m/s) at node i, column `3 j + b` component b of the force density (N/m, on
/// the fluid) at node j.
pub fn mobility(lines: &[&[V3]], epsilon: f64, viscosity: f64) -> DMatrix<f64> {
    let factor = stokeslet_factor(viscosity);
    let size: usize = lines.iter().map(|line| 3 * line.len()).sum();
    let mut matrix = DMatrix::zeros(size, size);
    for (i, x) in lines.iter().flat_map(|line| line.iter()).enumerate() {
        add_flow_at(*x, lines, epsilon, factor, 3 * i, &mut matrix);
    }
    matrix
}

/// Adds the flow at a point (m) to three rows of a matrix from `row` on: three columns a node, as in [`mobility`].
pub fn add_flow_at(x: V3, lines: &[&[V3]], epsilon: f64, factor: f64, row: usize, matrix: &mut DMatrix<f64>) {
    let mut column = 0;
    for line in lines {
        for edge in line.windows(2) {
            for (side, flow) in segment_flow(x, edge[0], edge[1], epsilon).iter().enumerate() {
                let mut block = matrix.fixed_view_mut::<3, 3>(row, column + 3 * side);
                block += flow * factor;
            }
            column += 3;
        }
        column += 3;
    }
}

/// Returns the weights that integrate a nodal density along a line: half the adjacent edge lengths, in m.
pub fn nodal_lengths(line: &[V3]) -> Vec<f64> {
    let mut weights = vec![0.0; line.len()];
    for (i, pair) in line.windows(2).enumerate() {
        let half = 0.5 * (pair[1] - pair[0]).norm();
        weights[i] += half;
        weights[i + 1] += half;
    }
    weights
}

/// Returns the resistance of rigid centre lines that move together: force and torque of the fluid on
/// them about `pivot` are minus this 6 x 6 matrix times (velocity at the pivot, angular velocity).
///
/// `spin_drag`: couple of the fluid on a rod that spins about its centre line, N m s per metre and radian, see
/// [`crate::rod::spin`]. `None` when the mobility matrix is singular to rounding.
pub fn rigid_resistance(
    lines: &[&[V3]],
    pivot: V3,
    epsilon: f64,
    viscosity: f64,
    spin_drag: f64,
) -> Option<Matrix6<f64>> {
    let factored = mobility(lines, epsilon, viscosity).lu();
    let nodes: Vec<V3> = lines.iter().flat_map(|line| line.iter().copied()).collect();
    let weights: Vec<f64> = lines.iter().flat_map(|line| nodal_lengths(line)).collect();
    let mut resistance = Matrix6::zeros();
    for column in 0..6 {
        let mut unit = V3::zeros();
        unit[column % 3] = 1.0;
        let velocity = DVector::from_iterator(
            3 * nodes.len(),
            nodes.iter().flat_map(|x| {
                let u = if column < 3 { unit } else { unit.cross(&(x - pivot)) };
                [u.x, u.y, u.z]
            }),
        );
        let density = factored.solve(&velocity)?;
        for (i, x) in nodes.iter().enumerate() {
            let force = V3::new(density[3 * i], density[3 * i + 1], density[3 * i + 2]) * weights[i];
            let torque = (x - pivot).cross(&force);
            for a in 0..3 {
                resistance[(a, column)] += force[a];
                resistance[(3 + a, column)] += torque[a];
            }
        }
    }
    for edge in lines.iter().flat_map(|line| line.windows(2)).map(|edge| edge[1] - edge[0]) {
        let couple = edge * edge.transpose() * (spin_drag / edge.norm());
        let mut torque = resistance.fixed_view_mut::<3, 3>(3, 3);
        torque += couple;
    }
    Some(resistance)
}
