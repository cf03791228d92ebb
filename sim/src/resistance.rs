//! The grand resistance matrix of the rigid robot at rest.
//!
//! Parts are the base and each flagellum. Each moves as a rigid body of its own; the matrix gives the force and the torque
//! that each part exerts on the fluid for the velocity and angular velocity of each. The flagella are regularised
//! Stokeslet segments ([`crate::fluid::mobility`]) with a round rod's couple on the spin about its own centre line. A
//! head that is a body in the flow is a surface of point forces ([`crate::fluid::head`]). One dense system couples all
//! of them. A tank adds its images ([`crate::fluid::tank`]); the robot is upright in it, at yaw 0.
//!
//! SI, body axes. Each part has six rows and columns, in the order of the parts: velocity (force) and then angular
//! velocity (torque), about the joint for the base, and about the foot of its shaft for a flagellum.
//!
//! The exact matrix is symmetric (reciprocal theorem). The matrix of collocated segments is symmetric only up to the
//! discretisation error, which [`Resistance::reciprocity_error`] gives; the returned matrix is its symmetric part.

use crate::V3;
use crate::body::shaft::Shaft;
use crate::fluid::head::{RigidSurface, rigid_motions, stokeslet};
use crate::fluid::mobility::{add_flow_at, mobility, nodal_lengths};
use crate::fluid::tank::TankFlow;
use crate::fluid::{Line, stokeslet_factor};
use crate::params::{ParamError, Robot};
use nalgebra::{DMatrix, Matrix3, UnitQuaternion};

/// The resistance of the robot's parts.
#[derive(Clone, Debug)]
pub struct Resistance {
    /// Force and torque on the fluid (N, N m) for velocity and angular velocity (m/s, rad/s), symmetric.
    pub matrix: DMatrix<f64>,
    /// The matrix before symmetrisation, as in the steps of a trial with rigid flagella.
    pub collocated: DMatrix<f64>,
    /// The largest difference, before symmetrisation, of two entries that are equal by the reciprocal theorem, over the
    /// geometric mean of the diagonal entries of their row and column.
    pub reciprocity_error: f64,
}

/// Returns the names of the parts.
pub fn parts(flagella: usize) -> Vec<String> {
    std::iter::once("base".into()).chain((1..=flagella).map(|k| format!("flagellum {k}"))).collect()
}

/// Returns the resistance of a robot at rest whose motors are at these angles, rad. With fewer angles than motors, the
/// last flagella are left out.
///
/// # Errors
/// An impossible parameter, or one with which the fluid's equations are singular.
pub fn resistance(robot: &Robot, angles: &[f64]) -> Result<Resistance, ParamError> {
    robot.validate()?;
    let flagella = flagella(robot, angles);
    of_parts(robot, &flagella)?.ok_or_else(|| singular(robot))
}

/// A rigid flagellum in the body frame, m.
pub(crate) struct Flagellum {
    pub foot: V3,
    pub nodes: Vec<V3>,
}

/// Returns the flagella at rest with the motors at these angles, rad.
pub(crate) fn flagella(robot: &Robot, angles: &[f64]) -> Vec<Flagellum> {
    let (feet, edges) = (robot.shaft_feet(), robot.flagellum.edges());
    (feet.iter().zip(angles).enumerate())
        .map(|(k, (foot, angle))| {
            let shaft = Shaft::new(*foot, *angle);
            let nodes = robot.flagellum.helix(k).nodes(edges);
            Flagellum { foot: *foot, nodes: nodes.iter().map(|x| shaft.point_to_body(*x)).collect() }
        })
        .collect()
}

/// Returns the error for equations of the fluid that are singular.
pub(crate) fn singular(robot: &Robot) -> ParamError {
    ParamError {
        key: "flagellum.edge_length_m",
        value: robot.flagellum.edge_length_m,
        reason: "the resistance of the rigid flagella cannot be computed with it".into(),
    }
}

fn of_parts(robot: &Robot, flagella: &[Flagellum]) -> Result<Option<Resistance>, ParamError> {
    let head = RigidSurface::of_head(robot)?;
    let points = head.as_ref().map_or(&[][..], |head| &head.points);
    let size = 6 * (1 + flagella.len());

    // Velocities of all nodes and points for each motion of a part, and the weights that sum their forces to loads.
    let count = flagella.iter().map(|f| f.nodes.len()).sum::<usize>() + points.len();
    let mut velocities = DMatrix::zeros(3 * count, size);
    let mut loads = DMatrix::zeros(size, 3 * count);
    let mut row = 0;
    let mut place = |x: V3, pivot: V3, part: usize, weight: f64| {
        let motions = rigid_motions(x - pivot);
        velocities.fixed_view_mut::<3, 6>(row, 6 * part).copy_from(&motions);
        loads.fixed_view_mut::<6, 3>(6 * part, row).copy_from(&(motions.transpose() * weight));
        row += 3;
    };
    for (k, flagellum) in flagella.iter().enumerate() {
        for (x, length) in flagellum.nodes.iter().zip(nodal_lengths(&flagellum.nodes)) {
            place(*x, flagellum.foot, 1 + k, length);
        }
    }
    for x in points {
        place(*x, V3::zeros(), 0, 1.0);
    }
    let Some(forces) = forces(robot, flagella, head.as_ref(), &velocities) else {
        return Ok(None);
    };
    let mut matrix = loads * forces;

    let spin_drag = robot.fluid.spin_drag * robot.round_spin_drag();
    let mut add = |part: usize, couple: Matrix3<f64>| {
        let mut block = matrix.fixed_view_mut::<3, 3>(6 * part + 3, 6 * part + 3);
        block += couple;
    };
    add(0, Matrix3::identity() * robot.base_drag());
    for (k, flagellum) in flagella.iter().enumerate() {
        for edge in flagellum.nodes.windows(2) {
            let edge = edge[1] - edge[0];
            // The spin is the part of the angular velocity along the tangent.
            add(1 + k, edge * edge.transpose() * (spin_drag / edge.norm()));
        }
    }
    Ok(Some(Resistance {
        reciprocity_error: reciprocity_error(&matrix),
        matrix: (&matrix + matrix.transpose()) * 0.5,
        collocated: matrix,
    }))
}

/// Returns the force densities (N/m) at all nodes and then the forces (N) at the head's points, on the fluid, for velocities
/// there (m/s), one column a motion; `None` if the equations are singular.
pub(crate) fn forces(
    robot: &Robot,
    flagella: &[Flagellum],
    head: Option<&RigidSurface>,
    velocities: &DMatrix<f64>,
) -> Option<DMatrix<f64>> {
    let mut mobility = coupled_mobility(robot, flagella, head);
    add_images(robot, flagella, head.map_or(&[][..], |head| &head.points), &mut mobility);
    mobility.lu().solve(velocities)
}

/// Returns the velocities (m/s) at all nodes and then the head's points for force densities (N/m) at the nodes and forces (N)
/// at the points.
fn coupled_mobility(robot: &Robot, flagella: &[Flagellum], head: Option<&RigidSurface>) -> DMatrix<f64> {
    let (epsilon, viscosity) = (robot.epsilon(), robot.fluid.viscosity());
    let lines: Vec<&[V3]> = flagella.iter().map(|f| f.nodes.as_slice()).collect();
    let own = mobility(&lines, epsilon, viscosity);
    let Some(head) = head else { return own };
    let factor = stokeslet_factor(viscosity);
    let (first, points) = (own.nrows(), &head.points);
    let size = first + 3 * points.len();
    let mut matrix = DMatrix::zeros(size, size);
    matrix.view_mut((0, 0), (first, first)).copy_from(&own);
    matrix.view_mut((first, first), (size - first, size - first)).copy_from(&head.mobility);
    for (p, x) in points.iter().enumerate() {
        let row = first + 3 * p;
        for (i, node) in lines.iter().flat_map(|line| line.iter()).enumerate() {
            let flow = stokeslet(node - x, epsilon * epsilon) * factor;
            matrix.fixed_view_mut::<3, 3>(3 * i, row).copy_from(&flow);
        }
        add_flow_at(*x, &lines, epsilon, factor, row, &mut matrix);
    }
    matrix
}

/// Adds the flow of the tank's images to a mobility of flagella and points of the head.
fn add_images(robot: &Robot, flagella: &[Flagellum], points: &[V3], mobility: &mut DMatrix<f64>) {
    let Some(tank) = &robot.tank else { return };
    let nodes: Vec<Vec<V3>> = flagella.iter().map(|f| f.nodes.clone()).collect();
    let mut flow = TankFlow::new(robot, tank, &nodes, points);
    let mut lines: Vec<Line> =
        nodes.into_iter().map(|nodes| Line { density: vec![V3::zeros(); nodes.len()], nodes }).collect();
    let mut forces = vec![0.0; 3 * points.len()];
    let upright = UnitQuaternion::identity();
    flow.begin(&lines, &upright);
    let mut add = |column: usize, lines: &[Line], forces: &[f64]| {
        flow.update(lines, forces, &upright);
        for (i, u) in flow.flow.iter().enumerate() {
            let mut entry = mobility.fixed_view_mut::<3, 1>(3 * i, column);
            entry += u;
        }
    };
    let mut column = 0;
    for k in 0..lines.len() {
        for i in 0..lines[k].nodes.len() {
            for axis in 0..3 {
                lines[k].density[i][axis] = 1.0;
                add(column, &lines, &forces);
                lines[k].density[i][axis] = 0.0;
                column += 1;
            }
        }
    }
    for i in 0..forces.len() {
        forces[i] = 1.0;
        add(column + i, &lines, &forces);
        forces[i] = 0.0;
    }
}

fn reciprocity_error(matrix: &DMatrix<f64>) -> f64 {
    let mut largest = 0f64;
    for row in 0..matrix.nrows() {
        for column in 0..row {
            let scale = (matrix[(row, row)] * matrix[(column, column)]).sqrt();
            if scale > 0.0 {
                largest = largest.max((matrix[(row, column)] - matrix[(column, row)]).abs() / scale);
            }
        }
    }
    largest
}
