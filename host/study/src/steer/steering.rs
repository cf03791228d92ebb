//! The control loop without a clock: observations in, set-points out.

use super::{Controller, Means, Measured, Observation, Policy, REACHED_DEG, SteerError, Wanted};
use biflag_log::schema::biflag::{self, Vector};
use protocol::units::CentiRpm;
use std::time::Duration;

/// A pilot's speeds, with the observation that they answer.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SetPoint {
    /// The observation.
    pub observation: Observation,
    /// Speeds of flagella 1 and 2.
    pub speeds: [CentiRpm; 2],
}

/// A steered run.
pub struct Steering {
    /// The target attitude.
    pub wanted: Wanted,
    pilot: Pilot,
    means: Means,
    /// Speeds of the last set-point.
    speeds: [CentiRpm; 2],
    /// Time of the last observation.
    last_s: Option<f64>,
    /// The unanswered observation, and the time since the one before it, s.
    asked: Option<(Observation, f64)>,
    /// Time since which the means have been near the target, s from the start of the run; `None` if they are not.
    pub reached_s: Option<f64>,
}

impl Steering {
    /// Begins with the robot at rest.
    pub fn new(wanted: Wanted, pilot: Pilot) -> Self {
        let means = Means::default();
        Self { wanted, pilot, means, speeds: [CentiRpm(0); 2], last_s: None, asked: None, reached_s: None }
    }

    /// Passes on the measured state at a time since the start of the run.
    ///
    /// # Errors
    /// Those of a policy.
    pub fn ask(&mut self, time_s: f64, measured: Measured) -> Result<(), SteerError> {
        self.means.push(time_s, [measured.yaw_deg, measured.pitch_deg]);
        let [mean_yaw_deg, mean_pitch_deg] = self.means.over_turns(self.speeds.map(CentiRpm::rpm));
        let observation = Observation { time_s, wanted: self.wanted, measured, mean_yaw_deg, mean_pitch_deg };
        let off_deg = [mean_yaw_deg - self.wanted.yaw_deg, mean_pitch_deg - self.wanted.pitch_deg];
        let is_near = off_deg.into_iter().all(|deg| deg.abs() <= REACHED_DEG);
        self.reached_s = self.reached_s.or(Some(time_s)).filter(|_| is_near);
        let period_s = self.last_s.replace(time_s).map_or(0.0, |last_s| time_s - last_s);
        if let Pilot::Policy(policy) = &mut self.pilot {
            policy.ask(&observation)?;
        }
        self.asked = Some((observation, period_s));
        Ok(())
    }

    /// Returns whether an observation waits for its answer.
    pub fn is_waiting(&self) -> bool {
        self.asked.is_some()
    }

    /// Returns the set-point for the last observation; `None` if the pilot does not answer within this time.
    ///
    /// # Errors
    /// Those of a policy.
    pub fn answer(&mut self, within: Duration) -> Result<Option<SetPoint>, SteerError> {
        let Some((observation, period_s)) = self.asked else { return Ok(None) };
        let answer = match &mut self.pilot {
            Pilot::Controller(controller) => Some(controller.speeds(&observation, period_s)),
            Pilot::Policy(policy) => policy.answer(within)?,
        };
        let Some(rpm) = answer else { return Ok(None) };
        self.asked = None;
        self.speeds = rpm.map(CentiRpm::from_rpm);
        Ok(Some(SetPoint { observation, speeds: self.speeds }))
    }
}

/// The source of the speeds.
pub enum Pilot {
    /// The built-in controller, which answers at once.
    Controller(Box<Controller>),
    /// An external program.
    Policy(Policy),
}

/// The times when a set-point was due, observed and in force.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Times {
    /// The board's clock when it was due, µs.
    pub due_us: u64,
    /// The board's clock at its observation, µs.
    pub observed_us: u64,
    /// The board's clock in the first frame with the set-point in force, µs; `None` if the next set-point came first.
    pub in_force_us: Option<u64>,
}

impl Times {
    /// Returns whether it was in force more than one period after it was due, or never.
    pub fn is_late(&self) -> bool {
        self.in_force_us.is_none_or(|in_force_us| in_force_us > self.due_us + super::PERIOD_US)
    }

    /// Returns the time from the observation until the set-point is in force, s.
    pub fn latency_s(&self) -> Option<f64> {
        Some((self.in_force_us?.saturating_sub(self.observed_us)) as f64 * 1e-6)
    }
}

/// Returns the message of a set-point. `time_s`: the trial's clock at its observation.
pub fn message(time_s: f64, times: &Times, set_point: &SetPoint) -> biflag::Steering {
    let SetPoint { observation, speeds } = set_point;
    let (wanted, measured) = (&observation.wanted, &observation.measured);
    let [x, y, z] = measured.rates_dps;
    biflag::Steering {
        time_s,
        due_us: times.due_us,
        observed_us: times.observed_us,
        in_force_us: times.in_force_us.unwrap_or_default(),
        late: times.is_late(),
        wanted_yaw_deg: wanted.yaw_deg,
        wanted_pitch_deg: wanted.pitch_deg,
        yaw_deg: measured.yaw_deg,
        pitch_deg: measured.pitch_deg,
        roll_deg: measured.roll_deg,
        mean_yaw_deg: observation.mean_yaw_deg,
        mean_pitch_deg: observation.mean_pitch_deg,
        angular_velocity_dps: Some(Vector { x, y, z }),
        speed1_rpm: measured.speeds_rpm[0],
        speed2_rpm: measured.speeds_rpm[1],
        turns1: measured.turns[0],
        turns2: measured.turns[1],
        target1_rpm: speeds[0].rpm(),
        target2_rpm: speeds[1].rpm(),
    }
}
