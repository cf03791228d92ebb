//! Time constants with which the robot returns to rest once its motors have stopped.
//!
//! The motion is overdamped: the fluid's drag R q' balances the forces K q that bring the robot back, so it is a sum of
//! exponentials whose time constants are the eigenvalues of K⁻¹ R. The coordinates q are the rotation of the base about its
//! joint and the bending of the flagella. The tether brings back the yaw, the righting moment the tilt. Soft flagella
//! lag behind the base, which makes the return slower: their compliance adds to the tether's.
//!
//! A flagellum bends as a cantilever with the flexural rigidity B of its helix. A bending moment about a horizontal axis
//! bends and twists the rod, which climbs at the angle a: over a turn of the helix,
//! 1/B = ((1 + sin² a)/(2 E I) + cos² a/(2 G J))/sin a per length along the axis (Wahl, Mechanical Springs, 1963, chapter
//! 20). Its net weight straightens it. The deflections are polynomials along the axis (Ritz's method). The drag is
//! computed for all nodes together, as in [`crate::resistance`].
//!
//! By symmetry, flagella bend against each other as the robot yaws, and together as it tilts. The phases of the helices
//! break this symmetry and are left out. Inertia is left out, too: its effect fades in milliseconds. SI, body axes.

use crate::V3;
use crate::body::joint::flagellum_righting;
use crate::fluid::head::RigidSurface;
use crate::fluid::mobility::nodal_lengths;
use crate::functions::powi;
use crate::params::{ParamError, Robot};
use crate::resistance::{Flagellum, flagella, forces, singular};
use nalgebra::{DMatrix, DVector};

/// Powers of a deflection's polynomials: at the clamp, both value and slope are zero.
const POWERS: [i32; 3] = [2, 3, 4];

/// Iterations for the largest eigenvalue, and the relative change at which they end.
const ITERATIONS: usize = 1000;
const CONVERGED: f64 = 1e-9;

/// The largest time constants of the return to rest, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeConstants {
    /// Of the yaw; infinite without a tether.
    pub yaw_s: f64,
    /// Of the tilt; infinite if nothing rights the robot.
    pub tilt_s: f64,
}

impl TimeConstants {
    /// Returns the time constants of a robot in the closure `full`.
    ///
    /// # Errors
    /// As [`crate::resistance::resistance`].
    pub fn of(robot: &Robot) -> Result<Self, ParamError> {
        robot.validate()?;
        let head = RigidSurface::of_head(robot)?;
        let flagella = flagella(robot, &[0.0; 2]);
        let yaw = [Motion::turn(2), Motion::bends(0, -1.0), Motion::bends(1, -1.0)].concat();
        let tilt = [Motion::turn(0), Motion::turn(1), Motion::bends(0, 1.0), Motion::bends(1, 1.0)].concat();
        let of = |motions: &[Motion]| -> Result<f64, ParamError> {
            let drag = drag(robot, &flagella, head.as_ref(), motions).ok_or_else(|| singular(robot))?;
            let restoring =
                DMatrix::from_fn(motions.len(), motions.len(), |i, j| restoring(robot, motions[i], motions[j]));
            Ok(restoring.lu().solve(&drag).map_or(f64::INFINITY, |map| largest_eigenvalue(&map)))
        };
        Ok(Self { yaw_s: of(&yaw)?, tilt_s: of(&tilt)? })
    }

    /// Returns the larger of both.
    pub fn slowest_s(&self) -> f64 {
        self.yaw_s.max(self.tilt_s)
    }
}

/// A coordinate of the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Motion {
    /// The rotation of the whole robot about a body axis through the joint, rad.
    Turn { axis: usize },
    /// The deflection of both flagella's tips along a body axis, m, with this sign for the second one. `power`: power
    /// of the polynomial.
    Bend { axis: usize, sign: f64, power: i32 },
}

impl Motion {
    fn turn(axis: usize) -> Vec<Self> {
        vec![Self::Turn { axis }]
    }

    fn bends(axis: usize, sign: f64) -> Vec<Self> {
        POWERS.map(|power| Self::Bend { axis, sign, power }).to_vec()
    }

    /// Returns the velocity for a unit rate at a point of flagellum `k`, `share` of its axial length below its foot.
    fn velocity(self, x: V3, k: usize, share: f64) -> V3 {
        match self {
            Self::Turn { axis } => V3::ith(axis, 1.0).cross(&x),
            Self::Bend { axis, sign, power } => V3::ith(axis, if k == 0 { 1.0 } else { sign }) * powi(share, power),
        }
    }
}

/// Returns the generalised drag for unit rates of the motions; `None` if the equations of the fluid are singular.
fn drag(
    robot: &Robot,
    flagella: &[Flagellum],
    head: Option<&RigidSurface>,
    motions: &[Motion],
) -> Option<DMatrix<f64>> {
    let points = head.map_or(&[][..], |head| &head.points);
    // For each point: its velocity for every motion, and the length that turns its force density into a force.
    let mut velocities: Vec<Vec<V3>> = Vec::new();
    let mut lengths = Vec::new();
    for (k, flagellum) in flagella.iter().enumerate() {
        for (x, length) in flagellum.nodes.iter().zip(nodal_lengths(&flagellum.nodes)) {
            let share = (flagellum.foot.z - x.z) / robot.flagellum.axial_length_m;
            velocities.push(motions.iter().map(|motion| motion.velocity(*x, k, share)).collect());
            lengths.push(length);
        }
    }
    for x in points {
        let of = |motion: &Motion| match motion {
            Motion::Turn { .. } => motion.velocity(*x, 0, 0.0),
            Motion::Bend { .. } => V3::zeros(),
        };
        velocities.push(motions.iter().map(of).collect());
        lengths.push(1.0);
    }
    let matrix =
        DMatrix::from_fn(3 * velocities.len(), motions.len(), |row, column| velocities[row / 3][column][row % 3]);
    let mut weighted = matrix.clone();
    for (row, mut values) in weighted.row_iter_mut().enumerate() {
        values *= lengths[row / 3];
    }
    let mut drag = weighted.transpose() * forces(robot, flagella, head, &matrix)?;
    let spin_drag = robot.fluid.spin_drag * robot.round_spin_drag();
    for (i, motion) in motions.iter().enumerate() {
        if let Motion::Turn { axis } = motion {
            let edges = flagella.iter().flat_map(|flagellum| flagellum.nodes.windows(2)).map(|edge| edge[1] - edge[0]);
            let spin: f64 = edges.map(|edge| edge[*axis] * edge[*axis] / edge.norm()).sum();
            drag[(i, i)] += spin_drag * spin + robot.base_drag() + robot.joint.viscous_nms;
        }
    }
    Some(drag)
}

/// Returns the generalised force against the first motion for a unit of the second.
fn restoring(robot: &Robot, one: Motion, other: Motion) -> f64 {
    let flagellum = &robot.flagellum;
    let length = flagellum.axial_length_m;
    let weight = robot.net_weight() * flagellum.helix(0).contour_length() / length;
    // Gravity on a tilted flagellum bends it: the axis points along -x for a turn about y, along +y for one about x.
    let lean = |turned: usize, axis: usize, power: i32| match (turned, axis) {
        (1, 0) => -2.0 * weight * length / f64::from(power + 1),
        (0, 1) => 2.0 * weight * length / f64::from(power + 1),
        _ => 0.0,
    };
    match (one, other) {
        (Motion::Turn { axis }, Motion::Turn { axis: other }) if axis == other => {
            let base = &robot.base;
            let of_flagella = if base.flagella_weight_on_base { 2.0 * flagellum_righting(robot) } else { 0.0 };
            match axis {
                2 => robot.joint.tether_full_nm_per_rad,
                _ => base.mass_kg * base.gravity_m_s2 * base.mass_centre_below_joint_m + of_flagella,
            }
        }
        (Motion::Bend { axis, power, .. }, Motion::Turn { axis: turned }) => lean(turned, axis, power),
        (Motion::Turn { axis: turned }, Motion::Bend { axis, power, .. }) if robot.base.flagella_weight_on_base => {
            lean(turned, axis, power)
        }
        (Motion::Bend { axis, power, .. }, Motion::Bend { axis: other, power: second, .. }) if axis == other => {
            let [p, q] = [power, second].map(f64::from);
            let elastic = flexural_rigidity(robot) / powi(length, 3) * p * (p - 1.0) * q * (q - 1.0) / (p + q - 3.0);
            let tension = weight * p * q * (1.0 / (p + q - 1.0) - 1.0 / (p + q));
            2.0 * (elastic + tension)
        }
        _ => 0.0,
    }
}

/// Returns the flexural rigidity of a flagellum as a straight beam along the axis of its helix, N m².
fn flexural_rigidity(robot: &Robot) -> f64 {
    let flagellum = &robot.flagellum;
    let stiffness = flagellum.stiffness();
    let sine = flagellum.axial_length_m / flagellum.helix(0).contour_length();
    let bending = (1.0 + sine * sine) / (2.0 * stiffness.bend_nm2);
    let twisting = (1.0 - sine * sine) / (2.0 * stiffness.twist_nm2);
    sine / (bending + twisting)
}

/// Returns the largest eigenvalue of a matrix by power iteration.
fn largest_eigenvalue(matrix: &DMatrix<f64>) -> f64 {
    // The first coordinate is the base's rotation, which is part of the slowest motion.
    let mut vector = DVector::from_fn(matrix.nrows(), |i, _| if i == 0 { 1.0 } else { 1e-3 });
    let mut value = 0.0;
    for _ in 0..ITERATIONS {
        let next = matrix * &vector;
        let size = next.norm();
        if !(size > 0.0 && size.is_finite()) {
            return f64::INFINITY;
        }
        let before = std::mem::replace(&mut value, size / vector.norm());
        vector = next / size;
        if (value - before).abs() < CONVERGED * value {
            break;
        }
    }
    value
}
