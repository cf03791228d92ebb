//! Times, time formulas, motor angles and shafts of one step.

use super::Solver;
use super::formula::{POINTS, derivative, value_at};
use crate::robot::clamp::{Motor, Shaft};
use crate::state::State;

/// Steps after contact in which the prediction takes fewer points.
const AFTER_CONTACT: u32 = 4;

/// All that is known of a step before it is solved.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    /// Length, s.
    pub step: f64,
    /// Time at its end, s.
    pub time: f64,
    /// Motors at its end.
    pub motors: [Motor; 2],
    /// Shafts at its end.
    pub shafts: [Shaft; 2],
    /// Points of the time formula, the new one included.
    pub points: usize,
    /// Weights of the derivative for each rod.
    pub weights: [[f64; POINTS]; 2],
    /// First weight over the step for each rod, 1/s.
    pub kappa: [f64; 2],
    /// Points of the prediction.
    pub predicted_from: usize,
    /// Weights of the prediction for each rod.
    pub prediction: [[f64; POINTS]; 2],
    /// Weights of the derivative for the body.
    pub body_weights: Vec<f64>,
    /// Weights of the prediction for the body.
    pub body_prediction: Vec<f64>,
}

impl Plan {
    pub(super) fn new(solver: &Solver, state: &State, step: f64, motors: [Motor; 2]) -> Self {
        let time = state.time + step;
        let mut times = vec![0.0, -1.0];
        times.extend(state.past.iter().map(|p| (p.time - time) / step));
        let points = POINTS.min(times.len());
        let most = if state.steps_since_contact < AFTER_CONTACT { POINTS - 1 } else { POINTS };
        let predicted_from = most.min(times.len() - 1);
        let (past, behind) = (&times[..points], &times[1..1 + predicted_from]);
        let formula = |speed: f64| (derivative(speed.abs() * step, past), value_at(speed.abs() * step, behind, 0.0));
        let rods = motors.map(|m| formula(m.speed));
        // The body follows both motors; the faster one needs the fit.
        let fastest = motors[0].speed.abs().max(motors[1].speed.abs());
        let body = formula(fastest);
        Self {
            step,
            time,
            motors,
            shafts: [0, 1].map(|k| Shaft::new(solver.feet[k], motors[k].angle)),
            points,
            weights: rods.map(|r| r.0),
            kappa: rods.map(|r| r.0[0] / step),
            predicted_from,
            prediction: rods.map(|r| r.1),
            body_weights: body.0[..points].to_vec(),
            body_prediction: body.1[..predicted_from].to_vec(),
        }
    }
}
