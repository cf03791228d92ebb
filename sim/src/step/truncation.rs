//! The estimated error of a step's time formula, which decides the length of steps.
//!
//! The new shape and attitude are compared with the extrapolation of the past in the formula's own basis; a known share
//! of the difference is the formula's error ([`super::formula::error_share`]). The error of a node is the sum of the
//! errors of the rod's shape in its shaft frame and of the attitude, which carries the whole rod: a displacement
//! against the fluid.
//!
//! Why a displacement: without inertia, loads on the clamps follow velocities against the fluid. An erroneous
//! displacement is an impulse of the fluid's drag. The error of a mean load over a window is the sum of the impulses of
//! its steps over the window's length. For a given number of steps, the sum is least when each step adds the same. So
//! the step control bounds the displacement of a step, not the displacement over the step's length, and the few steps
//! in which flagella snap past each other may be much shorter than the others. The root mean square over all nodes
//! bounds the mean displacement, which gives the force, and with the lever of the flagellum the moment that tilts the
//! base.

use super::flagellum::Flagellum;
use super::problem::StepProblem;
use crate::V3;
use crate::body::Body;
use crate::body::attitude::rotation_between;

/// Returns the estimated error of a step, m: displacement of the nodes against the fluid, root mean square over both rods;
/// zero if the past has too few points for an estimate. `next`: the base at its end.
pub fn error(flagella: &[Flagellum; 2], problem: &StepProblem, next: &Body) -> f64 {
    let StepProblem { state, step, .. } = problem;
    if !step.has_estimate {
        return 0.0;
    }
    let past = &state.past[..step.past_points - 1];
    let extrapolation = &step.body.extrapolation;
    let mut rotation = rotation_between(&next.attitude, &state.body.attitude) * extrapolation[0];
    for (p, weight) in past.iter().zip(&extrapolation[1..]) {
        rotation += rotation_between(&next.attitude, &p.attitude) * *weight;
    }
    // The extrapolation is measured from the new attitude.
    rotation *= -step.body.error_share;
    let (mut sum, mut nodes) = (0.0, 0);
    for (k, flagellum) in flagella.iter().enumerate() {
        let (weights, shaft) = (&step.rods[k], &step.shafts[k]);
        let rotation = shaft.to_shaft(rotation);
        let foot = rotation.cross(&shaft.to_shaft(shaft.foot));
        let before = &state.rods[k].shape.nodes;
        for (i, x) in flagellum.shape.nodes.iter().enumerate() {
            let mut difference: V3 = x - before[i] * weights.extrapolation[0];
            for (p, weight) in past.iter().zip(&weights.extrapolation[1..]) {
                difference -= p.shapes[k].nodes[i] * *weight;
            }
            sum += (difference * weights.error_share + foot + rotation.cross(x)).norm_squared();
        }
        nodes += flagellum.shape.nodes.len();
    }
    (sum / nodes as f64).sqrt()
}
