//! Turns by hand about a vertical axis, forwards and back: the scale of the gyroscope about that axis.
//!
//! A turn lasts from one rest to the next. The bias is interpolated between the two rests. This also removes the effect
//! of gravity on the rates, which is constant during the turn. Let y_m be the angle turned by the m-th rest and p_m the
//! angle of the mark there (0 or D). Least squares fit
//!
//! ```text
//! y_m = a + b m + (1 + s) p_m
//! ```
//!
//! with the scale error s and a drift b per turn, which absorbs errors of the bias at the rests. The scatter about the
//! fit is the operator's scatter at the marks; its degrees of freedom are the number of rests minus three. With fewer
//! than three turns, the term b is left out.

mod result;

pub use result::TurnResult;

use super::NotMeasured;
use super::file::{AXES, MeasuredSensor};
use super::reading::{Mean, Motion, RawReading, Rests};
use result::{evaluate, unit};
use sim::functions::hypot;

/// Shortest rest, s.
pub const REST_S: f64 = 3.0;

/// Longest wait for the next turn, s.
pub const PATIENCE_S: f64 = 60.0;

/// Longest stop within a turn, s.
const STOP_S: f64 = 20.0;

/// Rest after which a movement counts as over, s.
const OVER_S: f64 = 1.0;

/// Share by which a turn may differ from the requested angle: twice the scale's tolerance.
const TOLERANCE: f64 = 0.06;

/// A movement up to this angle is a jolt, degrees.
const JOLT_DEG: f64 = 15.0;

/// Smallest cosine of the angle between the axis and the measured vertical: 14°.
const VERTICAL: f64 = 0.97;

/// The requested turns.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct TurnPlan {
    /// The axis, 0 to 2.
    pub axis: usize,
    /// Angle of a turn.
    pub degrees: f64,
    /// Number of turns, forwards and back alternating.
    pub turns: usize,
}

/// One turn, from the mean time of a rest to the mean time of the next.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Turn {
    /// Angle about each body axis as measured by the sensor, degrees.
    pub angle_deg: [f64; 3],
    /// Its standard uncertainty due to the noise of the rests, degrees.
    pub noise_deg: [f64; 3],
    /// Duration, s.
    pub length_s: f64,
}

/// The operator's next action, with the figures so far.
#[derive(Clone, Copy, PartialEq, Debug)]
#[expect(missing_docs, reason = "the variants say what their fields are")]
pub enum TurnStep {
    /// Keep the sensor still for the remaining time.
    Rest { left_s: f64 },
    /// Turn the sensor now.
    Ready,
    /// The sensor is turning.
    Turning { angle_deg: f64 },
    /// The sensor stopped before the end of the turn.
    Stopped { angle_deg: f64 },
    /// All turns are done, or the operator has stopped turning.
    Done,
}

/// Follows the turns as the readings come in.
#[derive(Clone, Debug, Default)]
pub struct TurnWatch {
    plan: TurnPlan,
    rests: Rests,
    /// Readings from the beginning of the rest before a movement.
    readings: Vec<RawReading>,
    /// The rest before the present movement.
    from: Option<Mean>,
    /// Start of the present state, s.
    since_s: Option<f64>,
    /// Angle since the previous rest, without that rest's bias, degrees.
    angle_deg: [f64; 3],
    turns: Vec<Turn>,
    forces_g: Vec<[f64; 3]>,
}

impl TurnWatch {
    /// Returns a watch before the first reading.
    pub fn new(plan: TurnPlan) -> Self {
        Self { plan, ..Self::default() }
    }

    /// Returns the number of turns so far.
    pub fn count(&self) -> usize {
        self.turns.len()
    }

    /// Returns the requested angle of the next turn. The first turn defines the forward direction.
    fn wanted_deg(&self) -> f64 {
        let forwards = self.turns.first().map_or(self.angle_deg[self.plan.axis], |turn| turn.angle_deg[self.plan.axis]);
        let sign = if self.turns.len().is_multiple_of(2) { 1.0 } else { -1.0 };
        sign * self.plan.degrees * forwards.signum()
    }

    /// Adds a reading. Returns the operator's next action.
    ///
    /// # Errors
    /// [`NotMeasured`] after a mistake of the hand.
    pub fn push(&mut self, reading: &RawReading) -> Result<TurnStep, NotMeasured> {
        let since_s = *self.since_s.get_or_insert(reading.time_s);
        let motion = self.rests.push(reading);
        let rest = self.rests.rest;
        if let (Some(from), Some(previous)) = (&self.from, self.readings.last()) {
            let dt = reading.time_s - previous.time_s;
            for i in 0..3 {
                self.angle_deg[i] += dt * (0.5 * (reading.rate_dps[i] + previous.rate_dps[i]) - from.rate_dps[i]);
            }
        }
        self.readings.push(*reading);
        let is_resting = self.rests.is_resting();
        let angle_deg = self.angle_deg[self.plan.axis];
        let Some(from) = self.from else {
            return self.rest_first(motion, &rest, is_resting, reading.time_s - since_s);
        };
        let is_moved = self.angle_deg.iter().any(|angle| angle.abs() > JOLT_DEG);
        if !is_resting {
            return if is_moved {
                self.check_way().map(|()| TurnStep::Turning { angle_deg })
            } else {
                Ok(TurnStep::Ready)
            };
        }
        if !is_moved {
            return Ok(self.rest_again(motion, &rest));
        }
        if rest.length_s() < OVER_S {
            return Ok(TurnStep::Turning { angle_deg });
        }
        let wanted_deg = self.wanted_deg();
        let number = self.turns.len() + 1;
        if (angle_deg - wanted_deg).abs() > self.plan.degrees * TOLERANCE {
            if angle_deg.abs() > wanted_deg.abs() {
                return Err(self.too_far());
            }
            if rest.length_s() > STOP_S {
                let what = format!("turn {number} stopped at {angle_deg:.0}° of {wanted_deg:.0}°");
                let cure = "turn by the whole angle before you let it rest, or name the angle that you turn, such as \
                            `biflag sensor turn z 360`";
                return Err(NotMeasured::new(what, cure));
            }
            return Ok(TurnStep::Stopped { angle_deg });
        }
        if rest.length_s() < REST_S {
            return Ok(TurnStep::Rest { left_s: REST_S - rest.length_s() });
        }
        self.turns.push(turn(&self.readings, &from, &rest));
        self.begin_at(rest);
        Ok(if self.turns.len() < self.plan.turns { TurnStep::Ready } else { TurnStep::Done })
    }

    /// Handles the first rest, which measures the vertical.
    fn rest_first(
        &mut self,
        motion: Motion,
        rest: &Mean,
        is_resting: bool,
        waited_s: f64,
    ) -> Result<TurnStep, NotMeasured> {
        if motion == Motion::Moving {
            self.readings.clear();
        }
        if !is_resting || rest.length_s() < REST_S {
            if waited_s > PATIENCE_S {
                let what = format!("the sensor was not still for {REST_S:.0} s within {PATIENCE_S:.0} s");
                return Err(NotMeasured::new(what, "put it on a table that does not shake, and start again"));
            }
            let left_s = if is_resting { REST_S - rest.length_s() } else { REST_S };
            return Ok(TurnStep::Rest { left_s });
        }
        let up = unit(rest.force_g);
        if up[self.plan.axis].abs() < VERTICAL {
            let highest = (0..3).max_by(|a, b| up[*a].abs().total_cmp(&up[*b].abs())).unwrap_or_default();
            let sign = if up[highest] < 0.0 { "-" } else { "+" };
            let axis = AXES[self.plan.axis];
            let what = format!("{axis} is not vertical: {sign}{} points up", AXES[highest]);
            let cure = format!(
                "stand the sensor so that its {axis} axis points up or down, and start again; if it does, correct \
                 accel_axes in the board's settings"
            );
            return Err(NotMeasured::new(what, cure));
        }
        self.begin_at(*rest);
        Ok(TurnStep::Ready)
    }

    /// Handles a rest that continues or follows a jolt: the next turn begins at its end.
    fn rest_again(&mut self, motion: Motion, rest: &Mean) -> TurnStep {
        if motion == Motion::Still {
            if rest.length_s() >= REST_S {
                self.from = Some(*rest);
                self.angle_deg = [0.0; 3];
            }
            if rest.length_s() > PATIENCE_S {
                return TurnStep::Done;
            }
        }
        match REST_S - rest.length_s() {
            left_s if left_s > 0.0 => TurnStep::Rest { left_s },
            _ => TurnStep::Ready,
        }
    }

    fn begin_at(&mut self, rest: Mean) {
        self.forces_g.push(rest.force_g);
        self.from = Some(rest);
        self.angle_deg = [0.0; 3];
        self.readings.retain(|reading| reading.time_s >= rest.span_s[0]);
    }

    /// Refuses a turn about another axis or the wrong way, as early as possible.
    fn check_way(&self) -> Result<(), NotMeasured> {
        let TurnPlan { axis, degrees, .. } = self.plan;
        let angle_deg = self.angle_deg[axis];
        let other = (0..3).max_by(|a, b| self.angle_deg[*a].abs().total_cmp(&self.angle_deg[*b].abs())).unwrap_or(axis);
        let other_deg = self.angle_deg[other];
        if other != axis && other_deg.abs() > 45.0 && other_deg.abs() > 1.5 * angle_deg.abs() {
            let (axis, other) = (AXES[axis], AXES[other]);
            let what =
                format!("the sensor turned by {other_deg:.0}° about {other}, and by {angle_deg:.0}° about {axis}");
            let cure = format!(
                "turn it about its {axis} axis, flat on the table; if you did, correct gyro_axes in the board's settings"
            );
            return Err(NotMeasured::new(what, cure));
        }
        let (number, wanted_deg) = (self.turns.len() + 1, self.wanted_deg());
        if angle_deg * wanted_deg.signum() < -2.0 * JOLT_DEG {
            let what = format!("turn {number} went the wrong way: {angle_deg:.0}° instead of {wanted_deg:.0}°");
            return Err(NotMeasured::new(what, "turn forwards, then back by the same way, and so on; start again"));
        }
        if angle_deg.abs() > degrees * (1.0 + TOLERANCE) + 90.0 {
            return Err(self.too_far());
        }
        Ok(())
    }

    fn too_far(&self) -> NotMeasured {
        let (number, angle_deg, wanted_deg) = (self.turns.len() + 1, self.angle_deg[self.plan.axis], self.wanted_deg());
        let what = format!("turn {number} went on to {angle_deg:.0}° instead of {wanted_deg:.0}°");
        NotMeasured::new(what, "stop at the mark; start again")
    }

    /// Returns the result of the turns so far. `reference_deg`: largest difference between the angle of a turn and the
    /// nominal one; `known`: earlier measurements of the sensor; `clock`: the rate error of the board's clock,
    /// relative.
    ///
    /// # Errors
    /// [`NotMeasured`] without a turn.
    pub fn result(&self, reference_deg: f64, known: &MeasuredSensor, clock: f64) -> Result<TurnResult, NotMeasured> {
        let forces = self.forces_g.len() as f64;
        let mean = |i: usize| self.forces_g.iter().map(|force| force[i]).sum::<f64>() / forces;
        let force_g = std::array::from_fn(mean);
        evaluate(&self.plan, &self.turns, force_g, reference_deg, known, clock).ok_or_else(|| {
            let what = format!("the sensor was not turned within {PATIENCE_S:.0} s");
            NotMeasured::new(what, "start again, and turn it when the program says so")
        })
    }
}

/// Integrates the rates from the middle of a rest to the middle of the next one, minus the bias interpolated linearly
/// between the two rests.
fn turn(readings: &[RawReading], from: &Mean, to: &Mean) -> Turn {
    let within = |reading: &&RawReading| (from.time_s..=to.time_s).contains(&reading.time_s);
    let readings: Vec<_> = readings.iter().filter(within).collect();
    let length_s = to.time_s - from.time_s;
    let mut angle_deg = [0.0; 3];
    for pair in readings.windows(2) {
        let dt = pair[1].time_s - pair[0].time_s;
        let share = (0.5 * (pair[0].time_s + pair[1].time_s) - from.time_s) / length_s;
        for (i, angle) in angle_deg.iter_mut().enumerate() {
            let bias = from.rate_dps[i] + share * (to.rate_dps[i] - from.rate_dps[i]);
            *angle += dt * (0.5 * (pair[0].rate_dps[i] + pair[1].rate_dps[i]) - bias);
        }
    }
    let [u_from, u_to] = [from.rate_u_dps(), to.rate_u_dps()];
    let noise_deg = std::array::from_fn(|i| 0.5 * length_s * hypot(u_from[i], u_to[i]));
    Turn { angle_deg, noise_deg, length_s }
}

#[cfg(test)]
mod tests;
