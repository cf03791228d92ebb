//! The control loop without a clock: observations in, set-points out.

use super::{Means, Measured, Observation, Pilot, REACHED_DEG, SteerError, Wanted};
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
#[derive(Debug)]
pub struct Steering {
    wanted: Wanted,
    pilot: Pilot,
    means: Means,
    /// Speeds of the last set-point.
    speeds: [CentiRpm; 2],
    /// Time of the last observation.
    last_s: Option<f64>,
    /// The unanswered observation.
    asked: Option<Observation>,
    /// Time since which the means have been near the target, s.
    near_since_s: Option<f64>,
}

impl Steering {
    /// Begins with the robot at rest.
    pub fn new(wanted: Wanted, pilot: Pilot) -> Self {
        Self {
            wanted,
            pilot,
            means: Means::default(),
            speeds: [CentiRpm(0); 2],
            last_s: None,
            asked: None,
            near_since_s: None,
        }
    }

    /// Returns the target attitude.
    pub fn wanted(&self) -> Wanted {
        self.wanted
    }

    /// Passes on the measured state at a time since the start of the run.
    ///
    /// # Errors
    /// Those of a policy.
    pub fn ask(&mut self, time_s: f64, measured: Measured) -> Result<(), SteerError> {
        self.means.push(time_s, [measured.yaw_deg, measured.pitch_deg]);
        let [mean_yaw_deg, mean_pitch_deg] = self.means.over_turns(self.speeds.map(CentiRpm::rpm));
        let observation = Observation { time_s, wanted: self.wanted, measured, mean_yaw_deg, mean_pitch_deg };
        let is_near = observation.misses_deg().iter().all(|miss| miss.abs() <= REACHED_DEG);
        self.near_since_s = self.near_since_s.or(Some(time_s)).filter(|_| is_near);
        let period_s = self.last_s.replace(time_s).map_or(0.0, |last_s| time_s - last_s);
        self.pilot.ask(&observation, period_s)?;
        self.asked = Some(observation);
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
        let Some(observation) = self.asked else { return Ok(None) };
        let Some(rpm) = self.pilot.answer(within)? else { return Ok(None) };
        self.asked = None;
        self.speeds = rpm.map(CentiRpm::from_rpm);
        Ok(Some(SetPoint { observation, speeds: self.speeds }))
    }

    /// Returns the time since which the means have been near the target, s from the start of the run; `None` if they
    /// are not near it.
    pub fn reached_s(&self) -> Option<f64> {
        self.near_since_s
    }
}
