//! The data of a step before it is solved: times, time formulas, motor angles and shafts.

use super::formula::{POINTS, derivative, error_share, value_at};
use super::state::State;
use crate::V3;
use crate::body::shaft::{MotorState, Shaft};

/// A step to try.
#[derive(Clone, Copy, Debug)]
pub struct Attempt {
    /// Its length, s.
    pub length: f64,
    /// The motors at its end.
    pub motors: [MotorState; 2],
    /// Points of the time formula and of the extrapolation for its error, at most [`POINTS`].
    pub points: usize,
    /// Earlier points that the prediction may use, at most [`POINTS`].
    pub prediction_points: usize,
    /// Whether its frozen inverses are built at the predicted shapes, for rods that are about to buckle. If the step
    /// succeeds, the next ones keep these shapes.
    pub own_inverses: bool,
    /// Largest estimated error of an accepted step, m.
    pub allowed_error: f64,
    /// Estimated error after two sweeps above which the others are not computed, m.
    pub hopeless_error: f64,
}

impl Attempt {
    /// Returns whether the past of a state has enough points for an estimate of the step's error.
    pub fn has_estimate(&self, state: &State) -> bool {
        state.past.len() + 1 >= self.points
    }
}

/// The weights of a step's formulas.
#[derive(Clone, Copy, Debug)]
pub struct Weights {
    /// Of the derivative over the step: the new point first, then the past.
    pub derivative: [f64; POINTS],
    /// Of the prediction: the past, newest first. From all points it is the mean of the extrapolations from all of them and
    /// without the oldest one. The first amplifies the errors left by the iterations of earlier steps, the second is less
    /// accurate; the part of either error that two sweeps leave shows in the means.
    pub prediction: [f64; POINTS],
    /// Of the extrapolation for the error estimate: the past, newest first.
    pub extrapolation: [f64; POINTS],
    /// Error of the new point over its distance from the extrapolation.
    pub error_share: f64,
}

/// A step before it is solved.
#[derive(Clone, Debug)]
pub struct TimeStep {
    /// Length, s.
    pub length: f64,
    /// Time at its end, s.
    pub time: f64,
    /// Motors at its end.
    pub motors: [MotorState; 2],
    /// Shafts at its end.
    pub shafts: [Shaft; 2],
    /// Points of the time formulas, the new one included.
    pub points: usize,
    /// Points of the prediction.
    pub prediction_points: usize,
    /// Points of the extrapolation.
    pub past_points: usize,
    /// Whether there are as many as the attempt asks for: the estimate of the error needs them.
    pub has_estimate: bool,
    /// Weights for each rod, fitted to the speed of its own motor.
    pub rods: [Weights; 2],
    /// Weights for the body. It follows both motors, and the faster one needs the fit.
    pub body: Weights,
}

impl TimeStep {
    /// Returns the step of an attempt. `feet`: feet of the shafts, body frame, m.
    pub fn new(state: &State, feet: &[V3; 2], attempt: &Attempt) -> Self {
        let Attempt { length, motors, .. } = *attempt;
        let time = state.time + length;
        // In units of the step, from its end.
        let mut times = vec![0.0, -1.0];
        times.extend(state.past.iter().map(|p| (p.time - time) / length));
        let points = attempt.points.min(times.len());
        let past_points = attempt.points.min(times.len() - 1);
        let prediction_points = attempt.prediction_points.min(past_points);
        let behind = &times[1..1 + past_points];
        let fitted = |speed: f64| {
            let angle = speed.abs() * length;
            let derivative = derivative(angle, &times[..points]);
            let extrapolation = value_at(angle, behind, 0.0);
            let of = |points: usize| match points {
                same if same == past_points => extrapolation,
                fewer => value_at(angle, &behind[..fewer], 0.0),
            };
            let (most, fewer) = (of(prediction_points), of(prediction_points.min(POINTS - 1)));
            let prediction = std::array::from_fn(|j| 0.5 * (most[j] + fewer[j]));
            let error_share = error_share(derivative[0], behind[past_points - 1]);
            Weights { derivative, prediction, extrapolation, error_share }
        };
        let rods = motors.map(|m| fitted(m.speed));
        let faster = usize::from(motors[1].speed.abs() > motors[0].speed.abs());
        Self {
            length,
            time,
            motors,
            shafts: [0, 1].map(|k| Shaft::new(feet[k], motors[k].angle)),
            points,
            prediction_points,
            past_points,
            has_estimate: attempt.has_estimate(state),
            rods,
            body: rods[faster],
        }
    }

    /// Returns the first weight of rod `k` over the step's length, 1/s: the derivative's share of the new point.
    pub fn kappa(&self, k: usize) -> f64 {
        self.rods[k].derivative[0] / self.length
    }
}
